/* Interface of check_main.c, which has the main function of Check programs. */
#ifndef EBPO_TESTS_CHECK_MAIN_H
#define EBPO_TESTS_CHECK_MAIN_H

#include <check.h>

/* Check writes the location of every passed assertion into a pipe, which takes most of the time of
 * tests with millions of assertions. With this macro only failed assertions are written. */
#define _mark_point(file, line) ((void)0)

/* Returns the tests of the program, which defines this function. The function may print a reason
 * and end the program with TEST_SKIPPED. */
Suite *test_suite(void);

/* Begins the definition of a suite of a program with several suites (suites.c.in). */
#define TEST_SUITE(name)       \
    Suite *name##_suite(void); \
    Suite *name##_suite(void)

enum { TEST_SKIPPED = 77 };

/* Arguments of the program, without its name and the suite's; ends with NULL. */
extern char **test_arguments;

#endif
