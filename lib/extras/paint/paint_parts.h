/* Defines the content of a paint (annotations of a model: layers, strokes, notes), and declares
 * functions that the files of lib/extras/paint share. */
#ifndef EBPO_PAINT_PAINT_PARTS_H
#define EBPO_PAINT_PAINT_PARTS_H

#include <ebpo/paint.h>

#include <pthread.h>

#include "io/file_lock.h"
#include "io/publish.h"

#define EBPO_PAINT_FORMAT "EBP-Octree paint 1"
#define EBPO_PAINT_MAX    0x1p200 /* limit of positions and radii */

enum {
    EBPO_PAINT_FORMAT_MAJOR = 1,
    EBPO_PAINT_FORMAT_MINOR = 0,
    EBPO_PAINT_MINOR_MAX = 1 << 20,
    EBPO_PAINT_WEIGHTS = 1 << 30, /* sum of all three weights of a point */
    EBPO_PAINT_FULL = 1 << 15     /* size of a point whose radius is equal to its stroke's radius */
};
#define EBPO_PAINT_TIME_MAX (UINT64_C(1) << 53)

/* Order of the texts of a layer or of a note. A text is from malloc, and never NULL. */
enum { EBPO_PAINT_TITLE, EBPO_PAINT_AUTHOR, EBPO_PAINT_DATE, EBPO_PAINT_BODY, EBPO_PAINT_TEXTS };

/* A kind of text: the attribute's name, and its maximum number of bytes. */
typedef struct ebpo_paint_text_kind {
    const char *name;
    size_t max_bytes;
} ebpo_paint_text_kind;
extern const ebpo_paint_text_kind ebpo_paint_layer_texts[EBPO_PAINT_TEXTS];
extern const ebpo_paint_text_kind ebpo_paint_note_texts[EBPO_PAINT_TEXTS];
enum { EBPO_PAINT_TEXT_MAX = 32767 };

typedef struct ebpo_layer_data {
    char *text[EBPO_PAINT_TEXTS];
    uint64_t colour, opacity, visible;
} ebpo_layer_data;

typedef struct ebpo_note_data {
    char *text[EBPO_PAINT_TEXTS];
    uint64_t layer;
    ebpo_paint_point at;
} ebpo_note_data;

typedef struct ebpo_stroke_data {
    double radius;
    uint64_t time, first; /* first: index of the stroke's first point */
    uint32_t layer, kind, count;
    uint8_t rgba[4];
} ebpo_stroke_data;

/* The file of the annotations, with its version when it was read or last saved. Saving changes this
 * struct, but not the annotations (ebpo_paint). */
typedef struct ebpo_paint_file {
    pthread_mutex_t mutex; /* protects the other members during saving */
    char *path;            /* absolute path; NULL: no file yet */
    int fd;                /* keeps the file open, so that no later file gets the same inode; -1: no
                            * file */
    ebpo_file_version version;
    ebpo_file_lock lock; /* held from ebpo_paint_open_to_change until the paint is saved or freed */
} ebpo_paint_file;

struct ebpo_paint {
    ebpo_paint_file *file;
    char generator[64], model_sha256[65], model_name[256], unit[32];
    bool source_numbers; /* true: face indices are indices in the source; false: indices in the file
                          */
    ebpo_layer_data *layer;
    ebpo_note_data *note;
    ebpo_stroke_data *stroke;
    ebpo_paint_point *point;
    uint64_t layer_count, note_count, stroke_count, point_count;
    uint64_t layer_capacity, note_capacity, stroke_capacity, point_capacity;
};

static inline uint32_t ebpo_paint_pack(const uint8_t rgba[4])
{
    return (uint32_t)rgba[0] << 24 | (uint32_t)rgba[1] << 16 | (uint32_t)rgba[2] << 8 | rgba[3];
}

/* Returns the radius of a point's ball. */
static inline double ebpo_paint_radius(const ebpo_stroke_data *stroke,
                                       const ebpo_paint_point *point)
{
    return stroke->radius * point->size * 0x1p-15;
}

/* These functions return a message about what is wrong with a point or a stroke; NULL if it is
 * valid. layers: number of layers. */
const char *ebpo_paint_point_wrong(const ebpo_paint_point *point);
const char *ebpo_paint_stroke_wrong(const ebpo_stroke_data *stroke, uint64_t layers);

/* Allocates empty texts for a layer or a note. Returns false without memory. */
bool ebpo_paint_texts_begin(char *text[EBPO_PAINT_TEXTS]);

/* Returns an empty paint without a file; NULL without memory. */
ebpo_paint *ebpo_paint_begin(void);

/* Fails with EBPO_E_ARGUMENT or EBPO_E_ABSENT if the context is not of the paint's model, and with
 * EBPO_E_UNSUPPORTED if the model's coordinates are too large. */
EBPO_MUST_USE ebpo_status ebpo_paint_check_context(const ebpo_paint *paint,
                                                   const ebpo_context *context, ebpo_error *error);

#endif
