/* Parses command-line arguments by a table, checks them, and prints --help. The tables and the
 * manuals are generated from tools/cli/options/NAME.options: see
 * tools/cli/options/option_tables.py. */
#ifndef EBPO_TOOLS_ARGS_H
#define EBPO_TOOLS_ARGS_H

#include <float.h> /* for the tables */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum arg_kind {
    ARG_FLAG,   /* bool; no value */
    ARG_INT,    /* int64_t in [low, high] */
    ARG_REAL,   /* double in [low, high] */
    ARG_TEXT,   /* const char *, not empty */
    ARG_LIST,   /* arg_list; may be repeated */
    ARG_WORD,   /* int: index into `words` */
    ARG_SET,    /* uint32_t: bits by index into `words`; comma list, may be repeated */
    ARG_OPERAND /* the operand OUT, given as the option --output; `offset` is the operand's index */
} arg_kind;

typedef struct arg_option {
    const char *name; /* "max-level", without dashes; NULL ends the table */
    char letter;      /* short form, or 0 */
    arg_kind kind;
    size_t offset;     /* offset of the field in the values struct */
    const char *value; /* "N", for --help; NULL for flags */
    const char *help;
    double low, high;
    const char *const *words; /* NULL-terminated */
    const char *page; /* name of the page of `ebpo help` that describes the option; NULL: --help
                       * describes it */
} arg_option;

/* Texts in the order of the command line, NULL at the end. */
enum { ARG_LIST_MAX = 32 };
typedef struct arg_list {
    const char *item[ARG_LIST_MAX + 1];
    int count;
} arg_list;

typedef struct arg_spec {
    const char *command;  /* "convert" */
    const char *operands; /* "IN.ply OUT.ebpo.h5" */
    int least, most;      /* least and greatest number of operands */
    const char *summary;  /* one line */
    const char *text;     /* further text for --help, or NULL */
    const arg_option *options;
    /* Meaning of "-", one letter for each operand:
     *   i  standard input, by way of a file (standard_files.h)
     *   o  standard output, by way of a file
     *   p  the command interprets "-"
     * A blank, the end of the text or NULL: "-" is refused. */
    const char *dash;
    /* File name endings of the second operand's formats, such as "h5 hdf5"; known endings of other
     * formats are refused. */
    const char *writes;
} arg_spec;

/* Returns the letter of an operand in `dash`, or a blank. */
char args_dash(const arg_spec *spec, int operand);

typedef enum arg_result { ARGS_RUN, ARGS_HELPED, ARGS_WRONG } arg_result;

enum { ARGS_OPERANDS_MAX = 12 };

/* Parses argv[1 ..] into `values` (set to defaults before) and `operands` (unused ones NULL).
 * Options may be anywhere; "--" ends them. Prints --help on stdout, errors on stderr. */
arg_result args_parse(const arg_spec *spec, int argc, char **argv, void *values,
                      const char *operands[ARGS_OPERANDS_MAX]);

void args_help(const arg_spec *spec);

/* Prints the options of the command that have this page. */
void args_help_page(const arg_spec *spec, const char *page);

/* Reads `count` finite numbers separated by commas. Returns false for any other text. */
bool args_read_reals(const char *text, int count, double *out);

#endif
