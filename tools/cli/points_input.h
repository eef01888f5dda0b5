/* Reads the bytes of blocks of points, and records errors of a block. Only the files points*.c use
 * these functions. */
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

/* POINTS_BATCH: maximum number of rows that points_next returns. POINTS_WIDEST: greatest
 * points_width. */
enum { POINTS_BATCH = 4096, POINTS_WIDEST = 7 };

/* Returns the number of doubles in a query row: point 3, ray 7, box 6. */
int points_width(points_kind kind);
/* Returns the least number of numbers in an input row: point 3, ray 6, box 6. */
int points_raw_width(points_kind kind);

/* Layout of binary numbers. */
typedef struct points_layout {
    int per_row; /* number of numbers in a row: 6 or 7 for rays, else points_width */
    int bytes;   /* bytes of a number: 8 or 4 */
    bool big_endian;
} points_layout;

/* Consecutive rows of the input: at first as bytes, after points_parse also as doubles. */
typedef struct points_block {
    char *bytes;                   /* [capacity + 1] */
    size_t begin, count, capacity; /* the rows are bytes[begin] to bytes[count - 1] */
    const double *rows;            /* [row_count][points_width], after points_parse */
    uint64_t row_count;
    double *space;          /* memory for `rows`; not used if `rows` points into `bytes` */
    uint64_t capacity_rows; /* capacity of `space` in rows */
    uint64_t lines;         /* number of lines of text, including lines before `begin` */
    bool first;             /* true: this is the first block of the input */
    bool failed;            /* true: there is an error after the last row of the block */
    uint64_t fault_at;      /* line or row of the error, from 1 in this block; 0: no position */
    char fault[200];        /* message of the error */
} points_block;

/* An open input. */
typedef struct points {
    const char *command, *name; /* names of the command and of the input, for messages */
    points_kind kind;
    bool raw;       /* true: the input is binary numbers as in `layout`; false: text */
    bool header;    /* true: the first line of text names columns; may be set after points_open */
    bool no_header; /* true: the command accepts no header line */
    double tmax;    /* default for rays without tmax */
    int fd;         /* descriptor of the input */
    /* when this descriptor becomes readable, reading stops as at the end of the input; -1: none */
    int wake_fd;
    uint64_t bytes_total; /* bytes of the input file; 0: unknown */
    uint64_t bytes_taken; /* bytes read so far */
    bool limited;         /* true: only a part of the file is read (points_cut) */
    uint64_t bytes_left;  /* if `limited`: bytes of the part that are not read yet */
    char *unread; /* [unread_capacity] bytes that were read from fd, but are in no block yet */
    size_t unread_count, unread_capacity;
    bool is_begun;           /* true: the format has been recognised */
    bool taken;              /* true: a block has been taken */
    bool is_ended;           /* true: all bytes have been read */
    _Atomic bool failed;     /* true: an error was reported on stderr; exit with EXIT_FAILED */
    uint64_t line, row;      /* total number of lines, and of rows, in the finished blocks */
    uint64_t line_from;      /* offset in the file from which lines are counted */
    uint64_t rows_per_block; /* number of rows of a block in binary input */
    points_layout layout;
    bool rows_known;        /* true: rows_total is known */
    uint64_t rows_total;    /* number of rows of the input; after points_cut: of the part */
    bool rows_stated;       /* true: rows_total is from the header of an array, and must match */
    uint64_t rows_taken;    /* if rows_stated: number of rows taken so far */
    bool from_zero;         /* true: messages call the rows vertices, and count them from 0 */
    double *all_rows;       /* all rows, if the input is read completely at first; else NULL */
    uint64_t all_rows_at;   /* number of rows taken from `all_rows` */
    bool all_rows_are_part; /* true: `all_rows` has only the part that points_cut would select */
    /* with a header: for each value of a query row, the index of its column; -1: none */
    int field[POINTS_WIDEST];
    int fields;         /* with a header: number of columns; 0: not known yet */
    char separator;     /* with a header: separator of fields; 0: blanks */
    points_block batch; /* block for points_next */
    uint64_t batch_at;  /* number of rows of `batch` that points_next has returned */
} points;

/* POINTS_LINE: maximum length of a line of text in bytes. POINTS_TEXT: about the number of bytes of
 * text in a block. POINTS_FIELDS: maximum number of columns in a header. */
enum { POINTS_LINE = 1 << 18, POINTS_TEXT = 1 << 17, POINTS_FIELDS = 256 };

/* Value of `fault_at` for the line after the last line of the block. */
#define POINTS_NEXT_LINE UINT64_MAX

/* Records an error after the last row of a block. `at`: value for points_block.fault_at. Returns
 * false. */
__attribute__((format(printf, 3, 4))) bool points_fault(points_block *b, uint64_t at,
                                                        const char *format, ...);

/* Returns total * number / part_count, the beginning of part `number` of `part_count` parts. The
 * computation does not overflow, because `part_count` is at most 10^9. */
uint64_t points_share(uint64_t total, uint64_t number, uint64_t part_count);

/* Append input bytes to p->unread. points_fill appends the bytes of one read; points_fill_all
 * appends all bytes up to the end of the input. Return false after an error, which is then in the
 * block. */
bool points_fill(points *p, points_block *b);
bool points_fill_all(points *p, points_block *b);
/* Removes bytes from the beginning of p->unread. */
void points_drop(points *p, size_t bytes);

/* Reads once, at most `most` bytes. Returns the number of bytes; -1 after an error, which is then
 * in the block. */
ssize_t points_read_some(points *p, points_block *b, char *to, size_t most);
/* Returns true if more bytes can be read without waiting. This is always true for files. */
bool points_more_is_there(const points *p);
void points_block_free(points_block *block);

#endif
