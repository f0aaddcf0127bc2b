/* message.h: compares messages that list the names in a table, which grows. */
#ifndef DRAPE_TESTS_MESSAGE_H
#define DRAPE_TESTS_MESSAGE_H

#include <check.h>
#include <string.h>

/* In `expected`, "<*>", at most once, stands for any text. */
static inline void check_matches(const char *message, const char *expected)
{
    static const char any[] = "<*>";
    const char *gap = strstr(expected, any);
    if (!gap) {
        ck_assert_str_eq(message, expected);
        return;
    }
    const size_t before = (size_t)(gap - expected), after = strlen(gap) - strlen(any),
                 length = strlen(message);
    ck_assert_msg(length >= before + after && strncmp(message, expected, before) == 0 &&
                      strcmp(message + length - after, gap + strlen(any)) == 0,
                  "\"%s\" is not \"%s\"", message, expected);
}

#endif
