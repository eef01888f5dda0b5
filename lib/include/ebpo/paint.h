/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: paint and notes on a model, in a file of their own beside it.
 *
 *   Files      ebpo_paint_new, ebpo_paint_open, ebpo_paint_open_memory,
 *              ebpo_paint_open_to_change, ebpo_paint_save, ebpo_paint_free;
 *              ebpo_paint_get_info, ebpo_paint_check_model,
 *              ebpo_paint_check_points
 *   Layers     ebpo_paint_get_layer, ebpo_paint_add_layer, ebpo_paint_set_layer,
 *              ebpo_paint_remove_layer
 *   Notes      ebpo_paint_get_note, ebpo_paint_add_note, ebpo_paint_remove_note
 *   Strokes    ebpo_paint_get_stroke, ebpo_paint_add_stroke, ebpo_paint_remove_stroke
 *   A pen      ebpo_paint_lay, ebpo_paint_place: from where a hand was to strokes and notes
 *   Answers    ebpo_paint_cover, ebpo_paint_bake, ebpo_paint_dye_mesh, ebpo_paint_measure
 *
 *     ebpo_paint *paint = NULL;
 *     ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
 *     ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
 *     layer.title = "Cracks";
 *     pen.radius = 0.5;
 *     ebpo_paint_new(file, &paint, &error);
 *     ebpo_paint_add_layer(paint, &layer, &pen.layer, &error);
 *     ebpo_paint_lay(paint, context, hand, count, &pen, NULL, &error);
 *     ebpo_paint_save(paint, "model.paint.h5", &error);
 *
 * What the file says, and what exactly is painted, is in format-spec/paint.md: strokes are points
 * on faces, each a ball that paints what of the surface in it hangs together with the point.
 * Strokes cover each other in the order in which they were made; undoing is removing the last one.
 * The model is never changed.
 *
 * A paint is in memory as a whole, 48 bytes a point, and keeps a descriptor of its file open. What
 * asks the model keeps to the model's budget, beside what each function says. Texts and arrays that
 * are given out are the paint's, until it is changed or freed.
 *
 * Source of the task: EBP 2017, section 4.5 (painting by a haptic hand).
 */
#ifndef EBPO_PAINT_H
#define EBPO_PAINT_H

#include <ebpo/mesh.h>
#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_paint ebpo_paint;

/* At most so many of each in a file. */
enum {
    EBPO_PAINT_LAYERS = 1024,
    EBPO_PAINT_NOTES = 4096,
    EBPO_PAINT_STROKES = 1 << 20,
    EBPO_PAINT_POINTS = 1 << 24
};

/* ---- files ---- */

/*
 * An empty one for a model: no layers, no strokes.
 *
 * EBPO_E_ABSENT: the model has no mesh. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_new(const ebpo_file *model, ebpo_paint **out,
                                                  ebpo_error *error);

/*
 * Reads a file and checks all that can be checked without the model.
 *
 * EBPO_E_FORMAT: it is no paint file, or is damaged. EBPO_E_VERSION: of a later version.
 * EBPO_E_UNSUPPORTED: another program has laid it out in a way of its own. EBPO_E_IO,
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_open(const char *path, ebpo_paint **out,
                                                   ebpo_error *error);

/*
 * The same of bytes in memory, which are not needed afterwards.
 *
 * name   for messages; or NULL
 *
 * Errors are those of ebpo_paint_open.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_open_memory(const void *data, uint64_t size,
                                                          const char *name, ebpo_paint **out,
                                                          ebpo_error *error);

/*
 * Opens a file for a change that is saved, and makes others wait who do the same: between this and
 * the first ebpo_paint_save to `path`, or ebpo_paint_free, no other process or thread gets the file
 * by this function, and no other ebpo_paint_save replaces it. Changes of several programs follow
 * each other, and none is lost:
 *
 *     ebpo_paint_open_to_change("model.paint.h5", model, 60, NULL, &paint, &error);
 *     ebpo_paint_add_layer(paint, &layer, NULL, &error);
 *     ebpo_paint_save(paint, "model.paint.h5", &error);
 *     ebpo_paint_free(paint);
 *
 * model      where there is no file, the paint is a new one for this model; NULL: that is an error
 * wait       seconds to wait for others
 * progress   stage "waiting"; or NULL
 *
 * Two files that a thread opens so at once can make two programs wait for each other, until `wait`
 * is over. The lock is an empty file ".NAME.lock" in the same folder while it is held. On a
 * file system without locks (NFS without its lock service), in a folder that cannot be written
 * to, and where ".NAME.lock" is anything but an empty file, nobody waits; ebpo_paint_save still
 * compares.
 *
 * EBPO_E_IO: also where others take longer than `wait`. EBPO_E_CANCELLED, EBPO_E_ARGUMENT, and the
 * errors of ebpo_paint_open and ebpo_paint_new.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_open_to_change(const char *path,
                                                             const ebpo_file *model, double wait,
                                                             const ebpo_progress *progress,
                                                             ebpo_paint **out, ebpo_error *error);

/*
 * Writes it, whole or not at all.
 *
 * A paint belongs to the file that it was read from, or else to the first that it was saved as. A
 * save to that path replaces what this paint has read or saved there, and fails with EBPO_E_IO
 * where another program, or another ebpo_paint, has changed or replaced it since: open the file
 * again and repeat the change, or save to another path. A save to any other path replaces
 * what is there.
 *
 * Comparing and replacing are under a lock, which binds all that use this library, in any process
 * and thread; others may replace the file between the two. Without locks (as above) the time
 * between the two is the shortest possible, but not none.
 *
 * EBPO_E_UNSUPPORTED: the library was built without libhdf5. EBPO_E_IO: also where another one has
 * had the file open to change for 10 seconds. EBPO_E_MEMORY.
 *
 * Threads: any, while nobody changes the paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_save(const ebpo_paint *paint, const char *path,
                                                   ebpo_error *error);

/*
 * NULL is fine.
 *
 * Threads: one per paint.
 */
EBPO_API void ebpo_paint_free(ebpo_paint *paint);

typedef struct ebpo_paint_info {
    size_t struct_size; /* EBPO_PAINT_INFO_INIT sets it */

    /* What wrote the file, and which model it is for: its content_sha256, 64 hexadecimal digits,
     * and for people its name and unit; "": not known. */
    const char *generator, *model_sha256, *model_name, *unit;

    /* 1: faces have their numbers in the source. 0: those in the model's file. */
    uint64_t source_numbers;

    uint64_t layer_count, note_count, stroke_count, point_count;
} ebpo_paint_info;

#define EBPO_PAINT_INFO_INIT EBPO_SIZED(ebpo_paint_info)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any, while nobody changes the paint.
 */
EBPO_API ebpo_status ebpo_paint_get_info(const ebpo_paint *paint, ebpo_paint_info *out);

/*
 * Whether it is a paint of this model, or of the one that this is a subset of.
 *
 * EBPO_E_ARGUMENT: it is not; the message tells whose it is. EBPO_E_ABSENT: the model has no mesh,
 * or no numbers of the source where these are meant.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_check_model(const ebpo_paint *paint,
                                                          const ebpo_file *model,
                                                          ebpo_error *error);

/*
 * Checks that every point and note is on its face, or where a subset does not have the face or what
 * is around it. That is not in the file's checksums: whatever made the file may have written
 * other places. What asks the model of a point checks that point, too; this is for what is saved.
 *
 * context    of a model that fits
 * progress   stage "checking"; or NULL
 *
 * EBPO_E_FORMAT: one is not; the message has its number. EBPO_E_ARGUMENT, EBPO_E_ABSENT: as
 * ebpo_paint_check_model. EBPO_E_CANCELLED, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: one per context; any, while nobody changes the paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_check_points(const ebpo_paint *paint,
                                                           ebpo_context *context,
                                                           const ebpo_progress *progress,
                                                           ebpo_error *error);

/* ---- layers ---- */

/*
 * Texts are UTF-8 without control characters; lines are separated by U+2028. What is given is
 * copied; NULL stands for "".
 */
typedef struct ebpo_paint_layer {
    size_t struct_size; /* EBPO_PAINT_LAYER_INIT sets it */

    /* At most 255, 255, 31 and 4,095 bytes. The date is "" or one as in ISO 8601 (ebpo_is_date);
     * that which a file has may be any text, and may be kept. */
    const char *title, *author, *date, *description;

    /* For lists, and for pens to begin with: 0xRRGGBBAA. */
    uint32_t colour;

    /* 0 to 255, of all that is painted in it. */
    uint32_t opacity;

    /* 0 or 1. */
    uint64_t visible;
} ebpo_paint_layer;

#define EBPO_PAINT_LAYER_INIT                                                \
    {                                                                        \
        sizeof(ebpo_paint_layer), NULL, NULL, NULL, NULL, 0xd62728ff, 255, 1 \
    }

/*
 * EBPO_E_ARGUMENT: there is no such layer, or `out` was not begun with its macro.
 *
 * Threads: any, while nobody changes the paint.
 */
EBPO_API ebpo_status ebpo_paint_get_layer(const ebpo_paint *paint, uint64_t number,
                                          ebpo_paint_layer *out);

/*
 * A new one, above all others.
 *
 * number   its number; or NULL
 *
 * EBPO_E_ARGUMENT: a text or number is not as said above. EBPO_E_LIMIT: there are
 * EBPO_PAINT_LAYERS. EBPO_E_MEMORY.
 *
 * Threads: one per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_add_layer(ebpo_paint *paint,
                                                        const ebpo_paint_layer *layer,
                                                        uint64_t *number, ebpo_error *error);

/*
 * Says something else of it. The layer's own texts, as ebpo_paint_get_layer gives them, may be
 * among those given.
 *
 * Errors are those of adding; EBPO_E_ARGUMENT: there is no such layer.
 *
 * Threads: one per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_set_layer(ebpo_paint *paint, uint64_t number,
                                                        const ebpo_paint_layer *layer,
                                                        ebpo_error *error);

/*
 * Removes it with its strokes and notes; those above get the next lower numbers.
 *
 * EBPO_E_ARGUMENT: there is no such layer.
 *
 * Threads: one per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_remove_layer(ebpo_paint *paint, uint64_t number,
                                                           ebpo_error *error);

/* ---- points ---- */

/* A point on a face. */
typedef struct ebpo_paint_point {
    /* In the model's unit, finite, -2^200 to 2^200. */
    double place[3];

    /* In the source or in the file, as ebpo_paint_info tells: 0 to 2^32 - 2. */
    uint32_t face;

    /* Barycentric: of the second and third corner, in 2^-30; at most 2^30 in sum. The rest is the
     * first one's. */
    uint32_t weight[2];

    /* Milliseconds since the stroke's time. */
    uint32_t time;

    /* Of the stroke's radius, in 2^-15: 1 to 2^15. */
    uint16_t size;

    /* Of the pen, 65,535 for full. */
    uint16_t pressure;

    uint32_t reserved;
} ebpo_paint_point;

/* ---- notes ---- */

typedef struct ebpo_paint_note {
    size_t struct_size; /* EBPO_PAINT_NOTE_INIT sets it */

    /* At most 255, 255, 31 and 32,767 bytes; as of layers. */
    const char *title, *author, *date, *body;

    /* The layer that it belongs to. */
    uint64_t layer;

    /* Where it is; size, pressure and time do not count. */
    ebpo_paint_point at;
} ebpo_paint_note;

#define EBPO_PAINT_NOTE_INIT EBPO_SIZED(ebpo_paint_note)

/*
 * EBPO_E_ARGUMENT: there is no such note, or `out` was not begun with its macro.
 *
 * Threads: any, while nobody changes the paint.
 */
EBPO_API ebpo_status ebpo_paint_get_note(const ebpo_paint *paint, uint64_t number,
                                         ebpo_paint_note *out);

/*
 * EBPO_E_ARGUMENT: a text, place or layer is not as said above. EBPO_E_LIMIT: there are
 * EBPO_PAINT_NOTES. EBPO_E_MEMORY.
 *
 * Threads: one per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_add_note(ebpo_paint *paint,
                                                       const ebpo_paint_note *note,
                                                       ebpo_error *error);

/*
 * EBPO_E_ARGUMENT: there is no such note.
 *
 * Threads: one per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_remove_note(ebpo_paint *paint, uint64_t number,
                                                          ebpo_error *error);

/* ---- strokes ---- */

typedef enum ebpo_paint_kind {
    EBPO_PAINT_PAINTS = 0,
    EBPO_PAINT_ERASES = 1 /* takes away what earlier strokes of its layer have painted */
} ebpo_paint_kind;

typedef struct ebpo_paint_stroke {
    size_t struct_size; /* EBPO_PAINT_STROKE_INIT sets it */

    uint64_t layer;
    ebpo_paint_kind kind;

    /* 0xRRGGBBAA, of an erasing stroke 0: sRGB and how opaque it is. */
    uint32_t colour;

    /* Of points of full size, in the model's unit: 2^-200 to 2^200. */
    double radius;

    /* Milliseconds since 1970-01-01 UTC, at most 2^53; 0: not known. */
    uint64_t time;

    /* At least one. */
    uint64_t point_count;
    const ebpo_paint_point *points;
} ebpo_paint_stroke;

#define EBPO_PAINT_STROKE_INIT EBPO_SIZED(ebpo_paint_stroke)

/*
 * In the order in which they were made.
 *
 * EBPO_E_ARGUMENT: there is no such stroke, or `out` was not begun with its macro.
 *
 * Threads: any, while nobody changes the paint.
 */
EBPO_API ebpo_status ebpo_paint_get_stroke(const ebpo_paint *paint, uint64_t number,
                                           ebpo_paint_stroke *out);

/*
 * A new one, over those before.
 *
 * EBPO_E_ARGUMENT: something is not as said above. EBPO_E_LIMIT: there are EBPO_PAINT_STROKES, or
 * EBPO_PAINT_POINTS. EBPO_E_MEMORY.
 *
 * Threads: one per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_add_stroke(ebpo_paint *paint,
                                                         const ebpo_paint_stroke *stroke,
                                                         ebpo_error *error);

/*
 * Later ones get the next lower numbers. Of the last one: undo.
 *
 * EBPO_E_ARGUMENT: there is no such stroke.
 *
 * Threads: one per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_remove_stroke(ebpo_paint *paint, uint64_t number,
                                                            ebpo_error *error);

/* ---- a pen ---- */

/* Where a hand was. */
typedef struct ebpo_paint_hand {
    double place[3];

    /* 0 to 1; 0: it does not paint. */
    double pressure;

    /* Milliseconds since the first one, at most 2^32 - 1. */
    double time;
} ebpo_paint_hand;

typedef struct ebpo_paint_pen {
    size_t struct_size; /* EBPO_PAINT_PEN_INIT sets it */

    uint64_t layer;
    ebpo_paint_kind kind;
    uint32_t colour; /* as of strokes */

    /* Of the points it lays, as of strokes. */
    double radius;

    /*
     * Points are laid up to so far from where the pen is, in the model's unit, 0 to 2^200, on that
     * part of the surface within this distance that hangs together with it. 0: where the pen is.
     */
    double spread;

    /*
     * Points that are laid at each step at full pressure p = 1, of others the nearest whole number
     * of p times it, at least 1; 1 to 10,000. With no spread it is 1.
     */
    uint32_t density;

    uint32_t reserved;

    /*
     * Points' sizes at pressure 0 and 1, as shares of the radius, 2^-15 to 1; between them linear.
     */
    double size_least, size_full;

    /* A step along the hand's way, in the model's unit. 0: half of the greater of radius and
     * spread. Else at least 2^-200. */
    double step;

    /* The hand is lifted where it is farther from the surface than this; at least 0. INFINITY:
     * never. */
    double within;

    /* Of where points are laid. */
    uint64_t seed;

    /* As of strokes. */
    uint64_t time;

    ebpo_progress progress;
} ebpo_paint_pen;

#define EBPO_PAINT_PEN_INIT                                                            \
    {                                                                                  \
        sizeof(ebpo_paint_pen), 0, EBPO_PAINT_PAINTS, 0xd62728ff, 0, 0, 1, 0, 1, 1, 0, \
            __builtin_inf(), 1, 0,                                                     \
        {                                                                              \
            NULL, NULL                                                                 \
        }                                                                              \
    }

typedef struct ebpo_paint_laid {
    size_t struct_size; /* EBPO_PAINT_LAID_INIT sets it */

    /* Strokes and their points; steps at which the pen painted, and at which it was lifted. */
    uint64_t strokes, points, steps, lifted;

    /* Points that would have come to lie elsewhere: not within the spread, or on another fold. */
    uint64_t strayed;
} ebpo_paint_laid;

#define EBPO_PAINT_LAID_INIT EBPO_SIZED(ebpo_paint_laid)

/*
 * A hand's way becomes strokes, a new one wherever the pen was lifted: at each step along the way,
 * which goes straight from place to place, the pen is where the surface is nearest. The more
 * pressure, the more points; where they are depends on the seed and on nothing else.
 *
 * context   of a model that fits
 * hand      [count], at least 1
 * laid      what was done; or NULL
 *
 * On failure no stroke is added. EBPO_E_ARGUMENT: something is not as said above, or the model is
 * another one. EBPO_E_ABSENT, EBPO_E_CANCELLED, EBPO_E_LIMIT, EBPO_E_MEMORY, and the errors of
 * reading.
 *
 * Threads: one per paint, one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_lay(ebpo_paint *paint, ebpo_context *context,
                                                  const ebpo_paint_hand *hand, uint64_t count,
                                                  const ebpo_paint_pen *pen, ebpo_paint_laid *laid,
                                                  ebpo_error *error);

/*
 * The point of the surface nearest to a place, of full size, with pressure and time 0: for notes,
 * and for pens of one's own.
 *
 * Errors are those of ebpo_distance; EBPO_E_ARGUMENT also where the model is another one.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_place(const ebpo_paint *paint, ebpo_context *context,
                                                    const double place[3], ebpo_paint_point *out,
                                                    ebpo_error *error);

/* ---- answers ---- */

/* How answers are found out. */
typedef struct ebpo_paint_options {
    size_t struct_size; /* EBPO_PAINT_OPTIONS_INIT sets it */

    /*
     * Of areas, 1 to 65,536: where it is not clear to which stroke a part of a face belongs, it is
     * cut down to this part of the least radius around. 256 gives the area of a disc to 1 % for
     * certain, and `value` to 0.1 %.
     */
    unsigned fineness;

    /* Of areas and of baking. 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;
} ebpo_paint_options;

#define EBPO_PAINT_OPTIONS_INIT                            \
    {                                                      \
        sizeof(ebpo_paint_options), 256, 0, { NULL, NULL } \
    }

/* A face of a stroke's reach, lent until the function returns that is called with it. */
typedef struct ebpo_paint_face {
    /* As in ebpo_distance_result; and in the file. */
    uint64_t face, file_face;

    /* As the file stores them. */
    double corner[3][3];

    /* 1: this corner is covered. A face may have none, and be covered in its middle. */
    uint8_t covered[3];

    uint8_t reserved[5];
} ebpo_paint_face;

/* False: enough. */
typedef bool (*ebpo_paint_face_fn)(void *user, const ebpo_paint_face *face);

/*
 * The faces of the reach of a stroke's points, each once, in the order of the file, and which of
 * their corners are covered. Takes 110 bytes for each such face, and 300 for each that the box
 * around one point meets, as all that follows does.
 *
 * context     of a model that fits
 * elsewhere   points whose faces a subset does not have; or NULL
 *
 * EBPO_E_ARGUMENT: there is no such stroke, or the model is another one. EBPO_E_FORMAT: a point
 * does not lie on its face. EBPO_E_UNSUPPORTED: the model's coordinates are beyond 2^200.
 * EBPO_E_LIMIT: a point's ball meets more than 2^28 faces. EBPO_E_ABSENT, EBPO_E_MEMORY, and the
 * errors of reading.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_cover(const ebpo_paint *paint, ebpo_context *context,
                                                    uint64_t stroke, ebpo_paint_face_fn take,
                                                    void *user, uint64_t *elsewhere,
                                                    ebpo_error *error);

typedef struct ebpo_paint_baked {
    size_t struct_size; /* EBPO_PAINT_BAKED_INIT sets it */

    /* Vertices that a visible layer's stroke covers, also where it was erased. */
    uint64_t vertices;

    /* Points of visible layers; those whose faces a subset does not have; those that cover no
     * vertex, being smaller than their faces. */
    uint64_t points, elsewhere, between;
} ebpo_paint_baked;

#define EBPO_PAINT_BAKED_INIT EBPO_SIZED(ebpo_paint_baked)

/*
 * The colours of vertices with the visible layers over them.
 *
 * context   of a model that fits
 * mesh      as ebpo_file_read_source_mesh gives it of that model: its faces are needed
 * rgba      [vertex_count][4] in its order: the model's own colours, which become the new ones.
 *           Alpha stays. Where nothing covers a vertex, its colour stays.
 * baked     what was done; or NULL
 *
 * Takes, beside the mesh, 4 bytes a vertex, 72 for each covered one, and where numbers of faces in
 * the source have gaps 4 for each face.
 *
 * Errors are those of ebpo_paint_cover; EBPO_E_ARGUMENT also where the mesh is another one;
 * EBPO_E_CANCELLED. On failure the colours are as they were.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_bake(const ebpo_paint *paint, ebpo_context *context,
                                                   const ebpo_mesh *mesh,
                                                   const ebpo_paint_options *options, uint8_t *rgba,
                                                   ebpo_paint_baked *baked, ebpo_error *error);

/*
 * Gives a mesh's vertices these colours where they differ from those that it has
 * (ebpo_mesh_colours): in the properties red, green and blue (or diffuse_red and so on), which
 * keep their types (of which int8 holds no more than 127). A mesh without them gets them, as uint8,
 * of all vertices. All else stays.
 *
 * rgba   [vertex_count][4]; alpha is not looked at
 *
 * EBPO_E_ARGUMENT: the mesh has so many attributes that no more fit. EBPO_E_MEMORY.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_dye_mesh(ebpo_mesh *mesh, const uint8_t *rgba,
                                                       ebpo_error *error);

/* In the model's unit, squared. The area is from `lo` to `hi`, but for the rounding of sums (2^-40
 * of them); `value` is close to it. */
typedef struct ebpo_paint_area {
    double lo, value, hi;
} ebpo_paint_area;

/* Of what has one colour in one layer. */
typedef struct ebpo_paint_colour_area {
    uint64_t layer;
    uint32_t colour;
    uint32_t reserved;
    ebpo_paint_area area;
} ebpo_paint_colour_area;

typedef struct ebpo_paint_areas {
    size_t struct_size; /* EBPO_PAINT_AREAS_INIT sets it */

    /* Of all layers together. */
    ebpo_paint_area all;

    /* [layer_count], [stroke_count] of the paint; of erasing strokes 0 */
    ebpo_paint_area *layers, *strokes;

    /* [colour_count] by layer, then by colour */
    uint64_t colour_count;
    ebpo_paint_colour_area *colours;

    /* Faces of all reaches; points whose faces a subset does not have. */
    uint64_t faces, elsewhere;
} ebpo_paint_areas;

#define EBPO_PAINT_AREAS_INIT EBPO_SIZED(ebpo_paint_areas)

/*
 * How much of the surface is painted: visible layers and others, whatever their opacity. What a
 * later stroke of the same layer covers is no longer an earlier one's.
 *
 * out   freed by ebpo_paint_areas_free
 *
 * Takes 24 bytes for each face and point that reaches it, and 80 for each such face.
 *
 * Errors are those of ebpo_paint_cover; EBPO_E_ARGUMENT also for the fineness; EBPO_E_CANCELLED.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_measure(const ebpo_paint *paint,
                                                      ebpo_context *context,
                                                      const ebpo_paint_options *options,
                                                      ebpo_paint_areas *out, ebpo_error *error);

/*
 * Frees the arrays and clears the struct, but for its size.
 *
 * Threads: one per struct.
 */
EBPO_API void ebpo_paint_areas_free(ebpo_paint_areas *areas);

#ifdef __cplusplus
}
#endif
#endif
