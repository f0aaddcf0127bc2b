/* json_read.h: reading JSON with jansson, which drops characters of texts and digits of numbers where memory
 * runs out. */
#ifndef DRAPE_BASE_JSON_READ_H
#define DRAPE_BASE_JSON_READ_H

#include <jansson.h>

/* As json_loadb, but if any allocation failed it returns NULL with the code json_error_out_of_memory. */
json_t *drape_json_read(const char *text, size_t size, size_t flags, json_error_t *error);

#endif
