/*
 * comma.h: a locale whose numbers have a decimal comma. If none is installed, localedef of Debian's package
 * locales makes one in a temporary folder.
 */
#ifndef DRAPE_TESTS_COMMA_H
#define DRAPE_TESTS_COMMA_H

#include <locale.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool comma_is_set(void)
{
    return strcmp(localeconv()->decimal_point, ",") == 0;
}

/* False if there is none and none can be made: then the test has nothing to check. */
static bool comma_begin(void)
{
    static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"};
    char folder[] = "/tmp/drape_locale_XXXXXX", command[300];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (setlocale(LC_ALL, names[i]))
            return comma_is_set();
    if (!mkdtemp(folder))
        return false;
    snprintf(command, sizeof command, "localedef -i de_DE -f UTF-8 '%s/de_DE.UTF-8' >/dev/null 2>&1", folder);
    bool made =
        system(command) != -1 && setenv("LOCPATH", folder, 1) == 0 && setlocale(LC_ALL, "de_DE.UTF-8");
    snprintf(command, sizeof command, "rm -rf '%s'", folder); /* the locale that is set remains */
    if (system(command) != 0 || !made || !comma_is_set()) {
        fputs("no locale with a decimal comma: install Debian's package locales\n", stderr);
        return false;
    }
    return true;
}

static void comma_end(void)
{
    setlocale(LC_ALL, "C");
    unsetenv("LOCPATH");
}

#endif
