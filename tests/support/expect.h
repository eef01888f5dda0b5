/* Conditions in long loops: ck_assert tells its parent process each time that it is passed. */
#ifndef EBPO_TESTS_EXPECT_H
#define EBPO_TESTS_EXPECT_H

#include <check.h>

#define EXPECT(condition)                                      \
    do {                                                       \
        if (!(condition))                                      \
            ck_abort_msg("line %d: %s", __LINE__, #condition); \
    } while (0)

#define EXPECT_MSG(condition, ...)     \
    do {                               \
        if (!(condition))              \
            ck_abort_msg(__VA_ARGS__); \
    } while (0)

#endif
