/* What blocks of points are read from: the input's bytes, and what is wrong with a block. Between
 * the files that read points. */
#ifndef EBPO_TOOLS_POINTS_INPUT_H
#define EBPO_TOOLS_POINTS_INPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

typedef enum points_kind {
    POINTS,      /* x y z */
    POINTS_RAYS, /* ox oy oz dx dy dz tmax; the last number may be missing */
    POINTS_BOXES /* x0 y0 z0 x1 y1 z1, the lower corner first */
} points_kind;

enum { POINTS_BATCH = 4096, POINTS_WIDEST = 7 };

/* Doubles in a row as it is asked about: 3, 7, 6. */
int points_width(points_kind kind);
/* Doubles of one in raw input: 3, 6, 6. */
int points_raw_width(points_kind kind);

/* How the bytes of numbers that are not text are to be understood. */
typedef struct points_layout {
    int per_row; /* 6 or 7 for rays, as points_width for others */
    int bytes;   /* of a number: 8 or 4 */
    bool big_endian;
} points_layout;

typedef struct points_block {
    char *bytes; /* [capacity + 1] */
    size_t begin, count, capacity;
    const double *rows; /* [row_count][points_width], after points_parse */
    uint64_t row_count;
    double *room; /* rows that are not those of the bytes */
    uint64_t room_rows;
    uint64_t lines;    /* of text, those before `begin` included */
    bool first;        /* of the input */
    bool failed;       /* behind its last row: */
    uint64_t fault_at; /* line or row from 1 in this block, 0: the input as a whole */
    char fault[200];
} points_block;

typedef struct points {
    const char *command, *name; /* for messages */
    points_kind kind;
    bool raw;      /* doubles, or what `layout` tells */
    bool header;   /* the first line of text names columns; may be set after points_open */
    bool headless; /* the command takes no such line */
    double tmax;   /* of rays that tell none */
    int fd;
    int wake; /* when this can be read, waiting ends, as at the end of the input; -1: nothing */
    uint64_t bytes_total, bytes_taken; /* of a file; 0: not known how many */
    bool limited;                      /* only so many bytes more are read: */
    uint64_t bytes_left;
    char *rest; /* [rest_capacity] what was read and is not taken */
    size_t rest_count, rest_capacity;
    bool begun, taken, ended;
    _Atomic bool failed; /* said on stderr, the command shall end with EXIT_FAILED */
    uint64_t line, row;  /* that have passed */
    uint64_t line_from;  /* lines are counted from this byte of the file on */
    uint64_t together;   /* rows of a block, of input that is no text */
    points_layout layout;
    bool rows_known;          /* how many there are in all: */
    uint64_t rows_total;      /* may be cut short */
    bool rows_told;           /* by the head of an array, whose numbers must be as many */
    uint64_t rows_taken;      /* of such an array */
    bool from_zero;           /* rows are told as "vertex 0" */
    double *held;             /* all rows, of what is read as a whole; or NULL */
    uint64_t held_at;         /* those that have been taken */
    bool held_part;           /* they are the part that points_cut would take */
    int field[POINTS_WIDEST]; /* with a header: where each number stands; -1: nowhere */
    int fields;               /* and how many fields a line has; 0: not known yet */
    char separator;           /* between them; 0: blanks */
    points_block batch;       /* of points_next */
    uint64_t batch_at;
} points;

/* The longest line of text, and what is read at a time; columns that a header may name. */
enum { POINTS_LINE = 1 << 18, POINTS_TEXT = 1 << 17, POINTS_FIELDS = 256 };

/* As `fault_at`: the line behind those of the block. */
#define POINTS_BEHIND UINT64_MAX

/* What is wrong with a block, behind its last row; `at` as in `fault_at`. False. */
__attribute__((format(printf, 3, 4))) bool points_fault(points_block *b, uint64_t at,
                                                        const char *format, ...);

/* total * number / of: where part `number` of `of` begins; without overflow, as `of` is at most
 * 10^9. */
uint64_t points_share(uint64_t total, uint64_t number, uint64_t of);

/* Reads on, behind the `rest`, once or to the end; false after an error, which the block tells. */
bool points_fill(points *p, points_block *b);
bool points_fill_all(points *p, points_block *b);
/* Takes bytes from the beginning of `rest`. */
void points_drop(points *p, size_t bytes);

/* Once, up to `most` bytes; -1: it cannot be read, which the block tells. */
ssize_t points_read_some(points *p, points_block *b, char *to, size_t most);
/* More comes without waiting; files have all there is. */
bool points_more_is_there(const points *p);
void points_block_free(points_block *block);

#endif
