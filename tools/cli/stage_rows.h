/* Maps the stages of the library (the texts of its progress reports) to the rows of the table of
 * stages that users see. */
#ifndef EBPO_TOOLS_STAGE_ROWS_H
#define EBPO_TOOLS_STAGE_ROWS_H

/* The rows in the order in which their stages start, except that ordering and checking also run
 * before repairs. */
typedef enum stage_row {
    STAGE_READING,
    STAGE_REPAIR,
    STAGE_ORDERING,
    STAGE_CHECKING,
    STAGE_CUTTING,
    STAGE_CORNERS,
    STAGE_CELLS,
    STAGE_CHOOSING,
    STAGE_TOP,
    STAGE_ENVELOPES,
    STAGE_JOINING,
    STAGE_NUMBERING,
    STAGE_WRITING,
    STAGE_SELECTING,
    STAGE_OTHER,
    STAGE_ROWS
} stage_row;

/* The six stages of the thesis EBP 2017 (3.6.4, tables 8 to 10 and 18), as bits. */
enum {
    THESIS_LEAVES = 1 << 0,
    THESIS_CORNERS = 1 << 1,
    THESIS_LEAF_PLANES = 1 << 2,
    THESIS_PATHS = 1 << 3,
    THESIS_CLIPPING = 1 << 4,
    THESIS_STORING = 1 << 5,
    THESIS_STAGES = 6
};

typedef struct stage_name {
    const char *name;      /* name of the row */
    unsigned thesis;       /* bits of the thesis' stages that do the same work */
    const char *stages[8]; /* stages of the library that the row sums */
} stage_name;
extern const stage_name stage_names[STAGE_ROWS];

/* Returns the row of a stage of the library. */
stage_row stages_row(const char *library_stage);

#endif
