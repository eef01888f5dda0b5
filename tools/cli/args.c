#include "cli/args.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "cli/command.h"
#include "cli/renamed.h"
#include "cli/words.h"

static const arg_option help_option = {
    "help", 'h', ARG_FLAG, 0, NULL, "print this help and exit", 0, 0, NULL, NULL, NULL
};

/* Prints a usage error. The macro's value is ARGS_WRONG. */
#define refuse_args(spec, ...) (command_usage((spec)->command, __VA_ARGS__), ARGS_WRONG)

/* --- values --- */

static arg_result set_int(const arg_spec *spec, const arg_option *o, const char *text, int64_t *out)
{
    char *end;
    errno = 0;
    long long v = strtoll(text, &end, 10);
    if (end == text || *end || errno || (double)v < o->low || (double)v > o->high)
        return refuse_args(spec, "--%s: '%s' is not a whole number from %.0f to %.0f", o->name,
                           text, o->low, o->high);
    *out = v;
    return ARGS_RUN;
}

static arg_result set_real(const arg_spec *spec, const arg_option *o, const char *text, double *out)
{
    char *end;
    double v = strtod(text, &end);
    if (end == text || *end || !isfinite(v) || v < o->low || v > o->high)
        return refuse_args(spec, "--%s: '%s' is not a number from %g to %g", o->name, text, o->low,
                           o->high);
    *out = v;
    return ARGS_RUN;
}

static void join_words(const char *const *words, char *out, size_t capacity)
{
    size_t used = 0;
    out[0] = 0;
    for (int i = 0; words[i] && used < capacity; i++)
        used += (size_t)snprintf(out + used, capacity - used, "%s%s", i ? ", " : "", words[i]);
}

/* Sets *out to the index of the word text[length] in o->words. */
static arg_result find_word(const arg_spec *spec, const arg_option *o, const char *text,
                            size_t length, int *out)
{
    for (int i = 0; o->words[i]; i++)
        if (strlen(o->words[i]) == length && memcmp(o->words[i], text, length) == 0) {
            *out = i;
            return ARGS_RUN;
        }
    const char *current = renamed_word(o->name, text, length);
    if (current)
        return refuse_args(spec, "--%s: '%.*s' is now '%s'", o->name, (int)length, text, current);
    char all[200];
    join_words(o->words, all, sizeof all);
    return refuse_args(spec, "--%s: '%.*s' is not one of: %s", o->name, (int)length, text, all);
}

static arg_result set_bits(const arg_spec *spec, const arg_option *o, const char *text,
                           uint32_t *out)
{
    for (const char *at = text;; at++) {
        size_t length = strcspn(at, ",");
        int word = 0;
        arg_result result = find_word(spec, o, at, length, &word);
        if (result != ARGS_RUN)
            return result;
        *out |= 1u << word;
        at += length;
        if (!*at)
            return ARGS_RUN;
    }
}

static arg_result add_to_list(const arg_spec *spec, const arg_option *o, const char *text,
                              arg_list *out)
{
    if (out->count == ARG_LIST_MAX)
        return refuse_args(spec, "--%s: given more than %d times", o->name, ARG_LIST_MAX);
    out->item[out->count++] = text;
    return ARGS_RUN;
}

static arg_result set_value(const arg_spec *spec, const arg_option *o, const char *text,
                            void *values)
{
    void *field = (char *)values + o->offset;
    switch (o->kind) {
    case ARG_FLAG: *(bool *)field = true; return ARGS_RUN;
    case ARG_INT: return set_int(spec, o, text, field);
    case ARG_REAL: return set_real(spec, o, text, field);
    case ARG_WORD: return find_word(spec, o, text, strlen(text), field);
    case ARG_SET: return set_bits(spec, o, text, field);
    case ARG_LIST:
    case ARG_OPERAND:
    case ARG_TEXT: break;
    }
    if (!*text)
        return refuse_args(spec, "--%s: the value is empty", o->name);
    if (o->kind == ARG_LIST)
        return add_to_list(spec, o, text, field);
    *(const char **)field = text;
    return ARGS_RUN;
}

/* --- finding options --- */

static const arg_option *find_long(const arg_spec *spec, const char *name, size_t length)
{
    for (const arg_option *o = spec->options; o->name; o++)
        if (strlen(o->name) == length && memcmp(o->name, name, length) == 0)
            return o;
    return length == 4 && memcmp(name, "help", 4) == 0 ? &help_option : NULL;
}

static const arg_option *find_letter(const arg_spec *spec, char letter)
{
    for (const arg_option *o = spec->options; o->name; o++)
        if (o->letter == letter)
            return o;
    return letter == 'h' ? &help_option : NULL;
}

/* Returns the name of the option that shares the longest beginning with `name`, at least three
 * letters, for "did you mean"; NULL: there is none. */
static const char *find_similar(const arg_spec *spec, const char *name)
{
    const char *best = NULL;
    size_t best_length = 2;
    for (const arg_option *o = spec->options; o->name; o++) {
        size_t length = 0; /* number of equal letters */
        while (name[length] && name[length] == o->name[length])
            length++;
        if (length > best_length) {
            best = o->name;
            best_length = length;
        }
    }
    return best;
}

/* Refuses an unknown option. `shown`: the whole argument. `name`: the part of the argument that
 * begins with the unknown option's name or letter. */
static arg_result fail_unknown(const arg_spec *spec, const char *shown, const char *name)
{
    size_t length = strcspn(name, "=");
    const char *current = renamed_option(spec->command, name, length);
    if (current)
        return refuse_args(spec, "--%.*s is now %s", (int)length, name, current);
    const char *similar = find_similar(spec, name);
    if (similar)
        return refuse_args(spec, "unknown option '%s'; did you mean '--%s'?", shown, similar);
    return refuse_args(spec, "unknown option '%s'", shown);
}

/* --- parsing --- */

typedef struct parser {
    const arg_spec *spec;
    int argc, at; /* at: index of the next argument */
    char **argv;
    void *values;
    const char *output; /* value of the option --output, which stands for an operand; or NULL */
    size_t output_at;   /* index of the operand for which `output` stands */
    uint64_t limited; /* bit i: the option spec->options[i] was given, and has the member `only` */
} parser;

/* Takes an option and its value. `joined`: the value, if it is in the same argument
 * ("--name=VALUE"). If `joined` is NULL and the option has a value, the value is the next argument.
 */
static arg_result take_option(parser *p, const arg_option *o, const char *joined)
{
    if (o == &help_option) {
        args_help(p->spec);
        return ARGS_HELPED;
    }
    p->limited |= o->only ? UINT64_C(1) << (o - p->spec->options) : 0;
    if (o->kind == ARG_FLAG)
        return joined ? refuse_args(p->spec, "--%s takes no value", o->name)
                      : set_value(p->spec, o, NULL, p->values);
    if (!joined && p->at + 1 < p->argc)
        joined = p->argv[++p->at];
    if (!joined)
        return refuse_args(p->spec, "--%s needs a value, %s", o->name, o->value);
    if (o->kind == ARG_OPERAND && *joined) {
        p->output = joined;
        p->output_at = o->offset;
        return ARGS_RUN;
    }
    return set_value(p->spec, o, joined, p->values);
}

static arg_result take_long(parser *p)
{
    const char *shown = p->argv[p->at], *name = shown + 2;
    size_t length = strcspn(name, "=");
    const arg_option *o = find_long(p->spec, name, length);
    if (!o)
        return fail_unknown(p->spec, shown, name);
    return take_option(p, o, name[length] ? name + length + 1 : NULL);
}

/* Parses an argument of letters: -qh means -q -h. After the letter of an option with a value, the
 * value is all text up to the end of the argument. */
static arg_result take_letters(parser *p)
{
    const char *shown = p->argv[p->at];
    for (const char *c = shown + 1; *c; c++) {
        const arg_option *o = find_letter(p->spec, *c);
        if (!o)
            return fail_unknown(p->spec, shown, c);
        bool has_joined = o->kind != ARG_FLAG && c[1];
        arg_result result = take_option(p, o, has_joined ? c + 1 : NULL);
        if (result != ARGS_RUN || has_joined)
            return result;
    }
    return ARGS_RUN;
}

char args_dash(const arg_spec *spec, int operand)
{
    return spec->dash && operand < (int)strlen(spec->dash) ? spec->dash[operand] : ' ';
}

static bool is_among(const char *words, const char *word)
{
    size_t length = strlen(word);
    for (const char *at = words; *at; at += strspn(at, " ")) {
        size_t n = strcspn(at, " ");
        if (n == length && strncasecmp(at, word, n) == 0)
            return true;
        at += n;
    }
    return false;
}

/* Refuses an output name with the ending of another format, because such a name would mislead users
 * of the file. */
static arg_result check_ending(const arg_spec *spec, const char *path)
{
    static const char known[] = "ply obj stl off glb gltf vtk vtkhdf xdmf png jpg jpeg gif svg pdf "
                                "html json csv npy h5 hdf5 zip";
    const char *dot = strrchr(words_file_name(path), '.');
    if (!spec->writes || !dot || !is_among(known, dot + 1) || is_among(spec->writes, dot + 1))
        return ARGS_RUN;
    return refuse_args(spec, "'%s': the ending belongs to another format; the output is %s", path,
                       spec->operands + strcspn(spec->operands, " ") + 1);
}

static arg_result check_operand(const arg_spec *spec, const char *text, int i)
{
    if (strcmp(text, "-") == 0)
        return args_dash(spec, i) != ' '
                   ? ARGS_RUN
                   : refuse_args(spec,
                                 "'-': a file name is needed here, because the file is not read or "
                                 "written sequentially");
    return i == 1 ? check_ending(spec, text) : ARGS_RUN;
}

/* Adds the operand that was given as --output. */
static arg_result add_output(const parser *p, const char **operands, int *count)
{
    int at = (int)p->output_at;
    if (!p->output || *count < at)
        return ARGS_RUN;
    if (*count > at)
        return refuse_args(p->spec, "'%s' and --output '%s': give the output once", operands[at],
                           p->output);
    arg_result result = check_operand(p->spec, p->output, at);
    operands[(*count)++] = p->output;
    return result;
}

/* Returns true if the first operand is one of the words that are expected, such as "info|check". */
static bool is_expected(const char *words, const char *first)
{
    for (size_t length;; words += length + 1) {
        length = strcspn(words, "| ");
        if (strlen(first) == length && memcmp(words, first, length) == 0)
            return true;
        if (words[length] != '|')
            return false;
    }
}

/* Refuses a given option that cannot be used with the first operand. */
static arg_result check_limited(const parser *p, const char *first)
{
    if (!is_expected(p->spec->operands, first))
        return ARGS_RUN; /* the command refuses the operand */
    for (const arg_option *o = p->spec->options; o->name; o++)
        if (o->only && p->limited >> (o - p->spec->options) & 1 && !is_among(o->only, first))
            return refuse_args(p->spec, "--%s cannot be used with '%s', only with: %s", o->name,
                               first, o->only);
    return ARGS_RUN;
}

arg_result args_parse(const arg_spec *spec, int argc, char **argv, void *values,
                      const char *operands[ARGS_OPERANDS_MAX + 1])
{
    parser p = { .spec = spec, .argc = argc, .at = 1, .argv = argv, .values = values };
    int count = 0;
    bool options = true;
    memset(operands, 0, (ARGS_OPERANDS_MAX + 1) * sizeof *operands);
    for (; p.at < argc; p.at++) {
        const char *a = argv[p.at];
        arg_result result = ARGS_RUN;
        if (options && strcmp(a, "--") == 0)
            options = false;
        else if (options && a[0] == '-' && a[1] == '-')
            result = take_long(&p);
        else if (options && a[0] == '-' && a[1])
            result = take_letters(&p);
        else if (count == spec->most)
            result = refuse_args(spec, "unexpected argument '%s'; expected: %s", a, spec->operands);
        else if ((result = check_operand(spec, a, count)) == ARGS_RUN)
            operands[count++] = a;
        if (result != ARGS_RUN)
            return result;
    }
    arg_result added = add_output(&p, operands, &count);
    if (added != ARGS_RUN)
        return added;
    if (count < spec->least)
        return refuse_args(spec, "missing operand%s; expected: %s", count ? "" : "s",
                           spec->operands);
    return p.limited ? check_limited(&p, operands[0]) : ARGS_RUN;
}

/* --- help --- */

enum { HELP_WIDTH = 80, HELP_INDENT = 25 };

/* Prints words in lines of HELP_WIDTH characters. All lines after the first line begin at column
 * `indent`. */
static void print_wrapped(const char *text, int indent)
{
    int column = indent;
    for (const char *at = text; *at;) {
        int length = (int)strcspn(at, " ");
        if (column > indent && column + 1 + length > HELP_WIDTH) {
            printf("\n%*s", indent, "");
            column = indent;
        } else if (column > indent) {
            putchar(' ');
            column++;
        }
        printf("%.*s", length, at);
        column += length;
        at += length + (at[length] == ' ');
    }
    putchar('\n');
}

static void print_option(const arg_option *o)
{
    char head[80];
    int length = o->letter ? snprintf(head, sizeof head, "-%c, --%s", o->letter, o->name)
                           : snprintf(head, sizeof head, "--%s", o->name);
    if (o->value)
        length += snprintf(head + length, sizeof head - (size_t)length, " %s", o->value);
    printf("  %-22s ", head);
    if (length >= HELP_INDENT - 3)
        printf("\n%*s", HELP_INDENT, "");
    print_wrapped(o->help, HELP_INDENT);
}

void args_help(const arg_spec *spec)
{
    printf("usage: ebpo %s [options] %s\n\n", spec->command, spec->operands);
    print_wrapped(spec->summary, 0);
    if (spec->text)
        print_wrapped(spec->text, 0);
    printf("\noptions:\n");
    const char *page = NULL;
    for (const arg_option *o = spec->options; o->name; o++)
        if (o->page)
            page = o->page;
        else
            print_option(o);
    print_option(&help_option);
    if (page)
        printf("\nOptions for URLs: see 'ebpo help %s'.\n", page);
}

void args_help_page(const arg_spec *spec, const char *page)
{
    for (const arg_option *o = spec->options; o->name; o++)
        if (o->page && strcmp(o->page, page) == 0)
            print_option(o);
}

bool args_read_reals(const char *text, int count, double *out)
{
    for (int i = 0; i < count; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text || !isfinite(out[i]) || *end != (i + 1 < count ? ',' : 0))
            return false;
        text = end + 1;
    }
    return true;
}
