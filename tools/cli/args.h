/* Parses command-line arguments by a table, checks them, and prints --help. The tables and the
 * manuals are generated from tools/cli/options/NAME.options: see
 * tools/cli/options/option_tables.py. */
#ifndef EBPO_TOOLS_ARGS_H
#define EBPO_TOOLS_ARGS_H

#include <float.h> /* the generated tables use DBL_MAX */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum arg_kind {
    ARG_FLAG,   /* bool; the option has no value */
    ARG_INT,    /* int64_t in [low, high] */
    ARG_REAL,   /* double in [low, high] */
    ARG_TEXT,   /* const char *, not empty */
    ARG_LIST,   /* arg_list; the option may be repeated */
    ARG_WORD,   /* int: index into `words` */
    ARG_SET,    /* uint32_t: bit i means words[i]; a list with commas, which may be repeated */
    ARG_OPERAND /* the operand OUT, given as the option --output; `offset` is the operand's index */
} arg_kind;

/* An option of a command. */
typedef struct arg_option {
    const char *name; /* "max-level", without dashes; NULL ends the table */
    char letter;      /* short form; 0: none */
    arg_kind kind;
    size_t offset;     /* offset of the field to set in the command's struct of values */
    const char *value; /* word for the value in --help, such as "N"; NULL: a flag without a value */
    const char *help;  /* description for --help */
    double low, high;  /* range of ARG_INT and ARG_REAL */
    const char *const *words; /* values of ARG_WORD and ARG_SET, NULL-terminated */
    const char *page; /* name of the page of `ebpo help` that describes the option; NULL: --help
                       * describes it */
    const char *only; /* the first operands with which the option can be used, such as "plan pack";
                       * NULL: any */
} arg_option;

/* The values of a repeated option in the order of the command line. NULL follows the last value. */
enum { ARG_LIST_MAX = 32 };
typedef struct arg_list {
    const char *item[ARG_LIST_MAX + 1];
    int count;
} arg_list;

/* The operands and options of a command. */
typedef struct arg_spec {
    const char *command;  /* "convert" */
    const char *operands; /* "IN.ply OUT.ebpo.h5" */
    int least, most;      /* least and greatest number of operands */
    const char *summary;  /* description of the command in one line */
    const char *text;     /* further text for --help, or NULL */
    const arg_option *options;
    /* Meaning of "-" as an operand. The text has a letter for each operand:
     *   i  "-" is replaced by a temporary file with the bytes of standard input (standard_files.h)
     *   o  "-" is replaced by a temporary file, which is copied to standard output at the end
     *   p  the command itself interprets "-"
     * "-" is refused if the letter is a blank or missing, or if the text is NULL. */
    const char *dash;
    /* Endings of the second operand's file name, such as "h5 hdf5"; known endings of other formats
     * are refused. NULL: any ending. */
    const char *writes;
} arg_spec;

/* Returns the letter of an operand in spec->dash, or a blank. */
char args_dash(const arg_spec *spec, int operand);

typedef enum arg_result {
    ARGS_RUN,    /* the command is to run */
    ARGS_HELPED, /* --help was printed */
    ARGS_WRONG   /* an error was printed */
} arg_result;

/* Maximum number of operands: an expression and the models A to Z. */
enum { ARGS_OPERANDS_MAX = 27 };

/* Parses argv[1], argv[2], ... Options may be anywhere; all arguments after "--" are operands.
 * Prints --help on stdout, errors on stderr. `values`: the command's struct of values, which has
 * the defaults. `operands`: receives the operands, and NULL in all entries after them. */
arg_result args_parse(const arg_spec *spec, int argc, char **argv, void *values,
                      const char *operands[ARGS_OPERANDS_MAX + 1]);

/* Prints the text of --help. */
void args_help(const arg_spec *spec);

/* Prints the options of the command that this page of `ebpo help` describes. */
void args_help_page(const arg_spec *spec, const char *page);

/* Reads `count` finite numbers separated by commas. Returns false for any other text. */
bool args_read_reals(const char *text, int count, double *out);

#endif
