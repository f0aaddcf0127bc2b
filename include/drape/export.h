/* export.h: symbol visibility, C/C++ linkage, version. The only file that knows about C++ or visibility. */
#ifndef DRAPE_EXPORT_H
#define DRAPE_EXPORT_H

/* The version of this header; drape_version() returns that of the library. */
#define DRAPE_VERSION_MAJOR 0
#define DRAPE_VERSION_MINOR 1
#define DRAPE_VERSION_PATCH 0

#if defined(__GNUC__)
/* Marks what the shared library exports. */
#define DRAPE_API __attribute__((visibility("default")))
/* Lets the compiler check arguments against a printf format; both are argument numbers from 1. */
#define DRAPE_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define DRAPE_API
#define DRAPE_PRINTF(text, first)
#endif

#ifdef __cplusplus
/* Enclose the declarations that C and C++ share. */
#define DRAPE_C_BEGIN extern "C" {
#define DRAPE_C_END   }
#else
#define DRAPE_C_BEGIN
#define DRAPE_C_END
#endif

#endif
