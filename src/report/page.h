/* page.h: the page without its data, in two parts; embed.py makes them from page.html, style.css and the
 * scripts. */
#ifndef DRAPE_REPORT_PAGE_H
#define DRAPE_REPORT_PAGE_H

#include <stddef.h>

extern const unsigned char drape_page_head[], drape_page_tail[];
extern const size_t drape_page_head_size, drape_page_tail_size;

#endif
