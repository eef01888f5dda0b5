/* Reads the bytes of blocks of points, and records errors of a block. Internal to the files that
 * read points. */
#ifndef EBPO_TOOLS_POINTS_INPUT_H
#define EBPO_TOOLS_POINTS_INPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

typedef enum points_kind {
    POINTS,      /* x y z */
    POINTS_RAYS, /* ox oy oz dx dy dz tmax; tmax may be missing */
    POINTS_BOXES /* x0 y0 z0 x1 y1 z1, the lower corner first */
} points_kind;

enum { POINTS_BATCH = 4096, POINTS_WIDEST = 7 };

/* Returns the number of doubles in a query row: 3, 7, 6. */
int points_width(points_kind kind);
/* Returns the number of doubles in a raw row: 3, 6, 6. */
int points_raw_width(points_kind kind);

/* Layout of binary numbers. */
typedef struct points_layout {
    int per_row; /* 6 or 7 for rays, as points_width for others */
    int bytes;   /* bytes of a number: 8 or 4 */
    bool big_endian;
} points_layout;

typedef struct points_block {
    char *bytes; /* [capacity + 1] */
    size_t begin, count, capacity;
    const double *rows; /* [row_count][points_width], after points_parse */
    uint64_t row_count;
    double *space; /* memory for rows that differ from the bytes */
    uint64_t capacity_rows;
    uint64_t lines;    /* lines of text, including lines before `begin` */
    bool first;        /* true for the first block of the input */
    bool failed;       /* an error follows the last row of the block */
    uint64_t fault_at; /* its line or row, from 1 in this block; 0: the input as a whole */
    char fault[200];   /* its message */
} points_block;

typedef struct points {
    const char *command, *name; /* for messages */
    points_kind kind;
    bool raw;       /* the input is doubles, or numbers as in `layout` */
    bool header;    /* the first line of text names columns; may be set after points_open */
    bool no_header; /* the command accepts no header line */
    double tmax;    /* default for rays without it */
    int fd;
    int wake_fd; /* when it becomes readable, waiting ends as at the end of the input; -1: none */
    uint64_t bytes_total, bytes_taken; /* bytes of a file; 0: unknown */
    bool limited;                      /* only `bytes_left` bytes may still be read */
    uint64_t bytes_left;
    char *rest; /* [rest_capacity] bytes that were read, but are in no block yet */
    size_t rest_count, rest_capacity;
    bool is_begun, taken, is_ended;
    _Atomic bool failed;     /* reported on stderr; the command must end with EXIT_FAILED */
    uint64_t line, row;      /* numbers of lines and rows passed */
    uint64_t line_from;      /* lines are counted from this byte of the file */
    uint64_t rows_per_block; /* rows of a block in binary input */
    points_layout layout;
    bool rows_known;          /* rows_total is known */
    uint64_t rows_total;      /* rows to read: of the input, after points_cut of its part */
    bool rows_stated;         /* the header of an array states rows_total, which must match */
    uint64_t rows_taken;      /* rows taken of such an array */
    bool from_zero;           /* messages call rows "vertex 0" */
    double *held;             /* all rows of an input that is read completely; or NULL */
    uint64_t held_at;         /* number of rows taken from `held` */
    bool held_part;           /* `held` is already the part that points_cut would take */
    int field[POINTS_WIDEST]; /* with a header: position of each number; -1: none */
    int fields;               /* fields in a line; 0: not known yet */
    char separator;           /* between fields; 0: blanks */
    points_block batch;       /* block for points_next */
    uint64_t batch_at;
} points;

/* Longest line of text; bytes read at a time; maximum number of columns in a header. */
enum { POINTS_LINE = 1 << 18, POINTS_TEXT = 1 << 17, POINTS_FIELDS = 256 };

/* Value of `fault_at` for the line after the last line of the block. */
#define POINTS_NEXT_LINE UINT64_MAX

/* Records an error after the last row of a block; `at` as in `fault_at`. Returns false. */
__attribute__((format(printf, 3, 4))) bool points_fault(points_block *b, uint64_t at,
                                                        const char *format, ...);

/* Returns total * number / part_count, the beginning of part `number` of `part_count`; without
 * overflow, as `part_count` is at most 10^9. */
uint64_t points_share(uint64_t total, uint64_t number, uint64_t part_count);

/* Appends input bytes to `rest`: those of one read, or all up to the end of the input. Returns
 * false after an error, which is then in the block. */
bool points_fill(points *p, points_block *b);
bool points_fill_all(points *p, points_block *b);
/* Removes bytes from the beginning of `rest`. */
void points_drop(points *p, size_t bytes);

/* Reads once, at most `most` bytes. Returns the number of bytes; -1 after an error, which is then
 * in the block. */
ssize_t points_read_some(points *p, points_block *b, char *to, size_t most);
/* Returns true if more can be read without waiting; always for files. */
bool points_more_is_there(const points *p);
void points_block_free(points_block *block);

#endif
