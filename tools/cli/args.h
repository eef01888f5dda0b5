/* Command-line arguments from a table: parsing, checking and --help. The tables are made of
 * tools/cli/options/NAME.options, as the manuals are: see tools/cli/options/option_tables.py. */
#ifndef EBPO_TOOLS_ARGS_H
#define EBPO_TOOLS_ARGS_H

#include <float.h> /* for the tables */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum arg_kind {
    ARG_FLAG, /* bool; no value */
    ARG_INT,  /* int64_t in [low, high] */
    ARG_REAL, /* double in [low, high] */
    ARG_TEXT, /* const char *, not empty */
    ARG_LIST, /* arg_list; may be repeated */
    ARG_WORD, /* int: index into `words` */
    ARG_SET   /* uint32_t: bits by index into `words`; comma list, may be repeated */
} arg_kind;

typedef struct arg_option {
    const char *name; /* "max-level", without dashes; NULL ends the table */
    char letter;      /* short form, or 0 */
    arg_kind kind;
    size_t offset;     /* of the field in the values struct */
    const char *value; /* "N", for --help; NULL for flags */
    const char *help;
    double low, high;
    const char *const *words; /* NULL-terminated */
} arg_option;

/* Texts in the order in which they were given, NULL at the end. */
enum { ARG_LIST_MAX = 32 };
typedef struct arg_list {
    const char *item[ARG_LIST_MAX + 1];
    int count;
} arg_list;

typedef struct arg_spec {
    const char *command;  /* "convert" */
    const char *operands; /* "IN.ply OUT.ebpo.h5" */
    int least, most;      /* number of operands */
    const char *summary;  /* one line */
    const char *text;     /* more for --help, or NULL */
    const arg_option *options;
    /* What "-" is, a letter for each operand: 'i' standard input and 'o' output, by way of a file
     * (standard_files.h); 'p' what the command makes of it; a blank, the end or NULL: refused. */
    const char *dash;
    /* Endings that fit the second operand, "h5 hdf5"; those of other formats are refused. */
    const char *writes;
} arg_spec;

/* The letter of an operand, or a blank. */
char args_dash(const arg_spec *spec, int operand);

typedef enum arg_result { ARGS_RUN, ARGS_HELPED, ARGS_WRONG } arg_result;

enum { ARGS_OPERANDS_MAX = 12 };

/* Parses argv[1 ..] into `values` (set to defaults before) and `operands` (unused ones NULL).
 * Options may stand anywhere; "--" ends them.
 * --help is printed on stdout; what is wrong is said on stderr. */
arg_result args_parse(const arg_spec *spec, int argc, char **argv, void *values,
                      const char *operands[ARGS_OPERANDS_MAX]);

void args_help(const arg_spec *spec);

#endif
