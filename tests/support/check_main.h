/* The main function of Check programs: check_main.c. */
#ifndef EBPO_TESTS_CHECK_MAIN_H
#define EBPO_TESTS_CHECK_MAIN_H

#include <check.h>

/* Check writes the place of every passed assertion into a pipe, which takes most of the time of
 * tests that make millions of them. Only failed assertions are written. */
#define _mark_point(file, line) ((void)0)

/* What each program defines: its tests. It may end the program with
 * TEST_SKIPPED after saying why. */
Suite *test_suite(void);

/* Begins the definition of one suite of a program that has many (suites.c.in). */
#define TEST_SUITE(name)       \
    Suite *name##_suite(void); \
    Suite *name##_suite(void)

enum { TEST_SKIPPED = 77 };

/* What the program was called with, without its own name and the suite's; ends with NULL. */
extern char **test_arguments;

#endif
