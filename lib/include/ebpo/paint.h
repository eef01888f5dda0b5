/* SPDX-License-Identifier: MIT
 * Adds colours (paint) and notes to a model, in a separate file.
 *
 *   Files      ebpo_paint_new, ebpo_paint_open, ebpo_paint_open_memory, ebpo_paint_open_to_change,
 *              ebpo_paint_save, ebpo_paint_checkpoint, ebpo_paint_free; ebpo_paint_get_info,
 *              ebpo_paint_check_model, ebpo_paint_check_points
 *   Layers     ebpo_paint_get_layer, ebpo_paint_add_layer, ebpo_paint_set_layer,
 *              ebpo_paint_remove_layer
 *   Notes      ebpo_paint_get_note, ebpo_paint_add_note, ebpo_paint_remove_note
 *   Strokes    ebpo_paint_get_stroke, ebpo_paint_add_stroke, ebpo_paint_remove_stroke
 *   A pen      ebpo_paint_draw (makes strokes from device positions), ebpo_paint_locate
 *   Live pens  ebpo_paint_drawing_new, ebpo_paint_drawing_add, ebpo_paint_drawing_free: strokes
 *              while the positions arrive
 *   Results    ebpo_paint_cover, ebpo_paint_bake, ebpo_paint_colour_mesh, ebpo_paint_measure
 *
 *     ebpo_paint *paint = NULL;
 *     ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
 *     ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
 *     layer.title = "Cracks";
 *     pen.radius = 0.5;
 *     ebpo_paint_new(file, &paint, &error);
 *     ebpo_paint_add_layer(paint, &layer, &pen.layer, &error);
 *     ebpo_paint_draw(paint, context, input, count, &pen, NULL, &error);
 *     ebpo_paint_save(paint, "model.paint.h5", &error);
 *
 * format-spec/paint.md defines the file and the painted area. A *stroke* is a sequence of points on
 * faces. Each point has a ball, and paints the part of the surface that is in the ball and
 * connected to the point. Later strokes cover earlier strokes. To undo the last stroke, remove it.
 * The model is never changed.
 *
 * An ebpo_paint is entirely in memory: 48 bytes per point. An ebpo_paint keeps a descriptor of its
 * file open. Functions that query the model use memory within the model's budget (ebpo_model_new),
 * and in addition the memory that their comments state. Texts and arrays that functions return are
 * valid until the paint is changed or freed.
 *
 * Application: EBP 2017, section 4.5 (painting by a haptic device).
 */
#ifndef EBPO_PAINT_H
#define EBPO_PAINT_H

#include <ebpo/mesh.h>
#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The layers, strokes and notes of one model. */
typedef struct ebpo_paint ebpo_paint;

/* Maximum number of layers, of notes, of strokes and of points in a file. */
enum {
    EBPO_PAINT_LAYERS = 1024,
    EBPO_PAINT_NOTES = 4096,
    EBPO_PAINT_STROKES = 1 << 20,
    EBPO_PAINT_POINTS = 1 << 24
};

/* ---- files ---- */

/*
 * Makes an empty paint for a model.
 *
 * EBPO_E_ABSENT: the model has no mesh.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_new(const ebpo_file *model, ebpo_paint **out,
                                                  ebpo_error *error);

/*
 * Reads a file and makes all checks that do not need the model.
 *
 * EBPO_E_FORMAT: the file is not a paint file, or is damaged. EBPO_E_VERSION: the file has a later
 * version. EBPO_E_UNSUPPORTED: another program wrote a layout that is not supported. EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_open(const char *path, ebpo_paint **out,
                                                   ebpo_error *error);

/*
 * Reads a paint as ebpo_paint_open does, from bytes in memory. The bytes are not needed afterwards.
 * `name` is the name of the paint in messages, and may be NULL.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_open_memory(const void *data, uint64_t size,
                                                          const char *name, ebpo_paint **out,
                                                          ebpo_error *error);

/*
 * Opens a file to change it, and locks it against other changes. The lock ends with the first
 * ebpo_paint_save to `path`, or with ebpo_paint_free. Until then, no other process or thread can
 * open the file with this function, and no other ebpo_paint_save replaces it. So programs change
 * the file one after the other, and no change is lost:
 *
 *     ebpo_paint_open_to_change("model.paint.h5", model, 60, NULL, &paint, &error);
 *     ebpo_paint_add_layer(paint, &layer, NULL, &error);
 *     ebpo_paint_save(paint, "model.paint.h5", &error);
 *     ebpo_paint_free(paint);
 *
 * model      model for which a new paint is made if the file does not exist; NULL: the file must
 *            exist
 * wait       maximum time, in seconds, to wait for the lock of another program
 * progress   callback, which is called with the stage "waiting"; may be NULL
 *
 * If two programs each open two files in this way, they can block each other until `wait` has
 * passed. While a program has the lock, an empty file ".NAME.lock" is in the same folder. There is
 * no lock in three cases: the file system has no locks (NFS without its lock service), the folder
 * is not writable, or ".NAME.lock" is not an empty file. Even without a lock, ebpo_paint_save
 * detects changes by other programs.
 *
 * EBPO_E_IO: also if the lock is not free within `wait`. EBPO_E_CANCELLED. Also the errors of
 * ebpo_paint_open and ebpo_paint_new.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_open_to_change(const char *path,
                                                             const ebpo_file *model, double wait,
                                                             const ebpo_progress *progress,
                                                             ebpo_paint **out, ebpo_error *error);

/*
 * Writes the paint to a file, which is replaced atomically.
 *
 * A paint belongs to the file from which it was read. A paint that was not read from a file belongs
 * to the first file to which it was saved. A save to this file fails with EBPO_E_IO if another
 * program, or another ebpo_paint, has changed or replaced the file since this paint read or saved
 * it. In this case, open the file again and repeat the change, or save to another path. A save to
 * any other path replaces the file at that path.
 *
 * The save compares the file with the version that this paint read or saved, and then replaces the
 * file. A lock protects both steps against all users of this library, in any process and thread.
 * Programs that do not use this library may still replace the file between the two steps. If there
 * is no lock (see ebpo_paint_open_to_change), other users of this library may also replace the file
 * between the two steps.
 *
 * EBPO_E_UNSUPPORTED: the library was built without libhdf5. EBPO_E_IO: also if the lock is not
 * free within 10 seconds, because another program has opened the file to change it.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_save(const ebpo_paint *paint, const char *path,
                                                   ebpo_error *error);

/*
 * Saves the paint to the file to which it belongs (see ebpo_paint_save), and keeps the lock of
 * ebpo_paint_open_to_change, also after a failure. So a program can save often while it works, and
 * no other program can change the file meanwhile. The function does not wait for the disk: if the
 * program is killed, the file is complete, but after a power failure it may be damaged, unless the
 * program has called fsync for the file.
 *
 * EBPO_E_ARGUMENT: the paint belongs to no file. Other errors are those of ebpo_paint_save.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_checkpoint(const ebpo_paint *paint,
                                                         ebpo_error *error);

/*
 * Frees a paint.
 *
 * Threads: one at a time per paint.
 */
EBPO_API void ebpo_paint_free(ebpo_paint *paint);

/* Properties of a paint (ebpo_paint_get_info). */
typedef struct ebpo_paint_info {
    size_t struct_size;

    /*
     * generator: program that wrote the file. model_sha256: content_sha256 of the model, as 64
     * hexadecimal digits. model_name, unit: name and unit of the model. "": unknown.
     */
    const char *generator, *model_sha256, *model_name, *unit;

    /*
     * 1: indices of faces are source indices (indices in the mesh that was converted). 0: indices
     * of faces are indices in the model's file.
     */
    uint64_t source_numbers;

    /* Number of layers, notes, strokes, and points of all strokes. */
    uint64_t layer_count, note_count, stroke_count, point_count;
} ebpo_paint_info;

#define EBPO_PAINT_INFO_INIT EBPO_SIZED(ebpo_paint_info)

/*
 * Gets the properties of a paint.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_paint_get_info(const ebpo_paint *paint, ebpo_paint_info *out);

/*
 * Checks that the paint belongs to `model`, or to the model from which the subset `model` was made.
 *
 * EBPO_E_ARGUMENT: the paint belongs to another model, which the message names. EBPO_E_ABSENT: the
 * model has no mesh, or lacks the required source indices.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_check_model(const ebpo_paint *paint,
                                                          const ebpo_file *model,
                                                          ebpo_error *error);

/*
 * Checks that every point and note is on its face. Points whose faces or surroundings are missing
 * in a subset are not checked. The checksums of the file do not ensure that points are on their
 * faces, because the program that wrote the file may have stored wrong positions. Functions that
 * query the model at a stored point check this point themselves. If your program uses stored points
 * in another way, call this function first.
 *
 * context    context of a matching model (ebpo_paint_check_model)
 * progress   callback, which is called with the stage "checking"; may be NULL
 *
 * EBPO_E_FORMAT: a point is not on its face; the message gives the index of the point.
 * EBPO_E_ARGUMENT, EBPO_E_ABSENT: as for ebpo_paint_check_model. EBPO_E_CANCELLED. Also the errors
 * of reading (base.h).
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_check_points(const ebpo_paint *paint,
                                                           ebpo_context *context,
                                                           const ebpo_progress *progress,
                                                           ebpo_error *error);

/* ---- layers ---- */

/*
 * Properties of a layer. Texts are UTF-8 without control characters; U+2028 separates lines.
 * Arguments are copied; NULL means "".
 */
typedef struct ebpo_paint_layer {
    size_t struct_size;

    /*
     * Maximum sizes in bytes: title 255, author 255, date 31, description 4,095. The date is "" or
     * valid for ebpo_is_date. A date that was read from a file may be any text.
     * ebpo_paint_set_layer accepts this text if it is the layer's current date.
     */
    const char *title, *author, *date, *description;

    /*
     * Colour of the layer in lists of layers, and default colour for pens that paint in the layer:
     * 0xRRGGBBAA.
     */
    uint32_t colour;

    /* Opacity of the whole layer, 0 to 255. */
    uint32_t opacity;

    /* 1: the layer is visible. 0: the layer is invisible. */
    uint64_t visible;
} ebpo_paint_layer;

#define EBPO_PAINT_LAYER_INIT                                                \
    {                                                                        \
        sizeof(ebpo_paint_layer), NULL, NULL, NULL, NULL, 0xd62728ff, 255, 1 \
    }

/*
 * Gets layer `number`, 0 to layer_count - 1. EBPO_E_ARGUMENT: the number is out of range.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_paint_get_layer(const ebpo_paint *paint, uint64_t number,
                                          ebpo_paint_layer *out);

/*
 * Adds a layer above all other layers.
 *
 * number   receives the index of the new layer; may be NULL
 *
 * EBPO_E_ARGUMENT: a member is not valid. EBPO_E_LIMIT: EBPO_PAINT_LAYERS layers exist.
 *
 * Threads: one at a time per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_add_layer(ebpo_paint *paint,
                                                        const ebpo_paint_layer *layer,
                                                        uint64_t *number, ebpo_error *error);

/*
 * Replaces the properties of layer `number`. The texts in `layer` may be those that
 * ebpo_paint_get_layer returned for this layer.
 *
 * Errors are those of ebpo_paint_add_layer.
 *
 * Threads: one at a time per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_set_layer(ebpo_paint *paint, uint64_t number,
                                                        const ebpo_paint_layer *layer,
                                                        ebpo_error *error);

/*
 * Removes layer `number` with its strokes and notes. The indices of higher layers decrease by one.
 *
 * Threads: one at a time per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_remove_layer(ebpo_paint *paint, uint64_t number,
                                                           ebpo_error *error);

/* ---- points ---- */

/* A point on a face. */
typedef struct ebpo_paint_point {
    /* Position in the model's unit: finite, -2^200 to 2^200. */
    double place[3];

    /*
     * Index of the face in the source or in the file (source_numbers of ebpo_paint_info): 0 to 2^32
     * - 2.
     */
    uint32_t face;

    /*
     * Barycentric weights of the second and third corner, in units of 2^-30. Their sum is at most
     * 2^30; the weight of the first corner is the difference from 2^30.
     */
    uint32_t weight[2];

    /* Time since `time` of the stroke, in milliseconds. */
    uint32_t time;

    /* Radius of the point's ball: share of the stroke's radius in units of 2^-15, 1 to 2^15. */
    uint16_t size;

    /* Pressure of the pen, 0 to 65,535 (full pressure). */
    uint16_t pressure;

    uint32_t reserved;
} ebpo_paint_point;

/* ---- notes ---- */

/* A note. Arguments are copied; NULL texts mean "". */
typedef struct ebpo_paint_note {
    size_t struct_size;

    /*
     * Maximum sizes in bytes: title 255, author 255, date 31, body 32,767. The other rules of
     * ebpo_paint_layer also apply.
     */
    const char *title, *author, *date, *body;

    /* Index of the layer of the note. */
    uint64_t layer;

    /* Position of the note; size, pressure and time of the point are ignored. */
    ebpo_paint_point at;
} ebpo_paint_note;

#define EBPO_PAINT_NOTE_INIT EBPO_SIZED(ebpo_paint_note)

/*
 * Gets note `number`, 0 to note_count - 1. EBPO_E_ARGUMENT: the number is out of range.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_paint_get_note(const ebpo_paint *paint, uint64_t number,
                                         ebpo_paint_note *out);

/*
 * Adds a note. EBPO_E_ARGUMENT: a text, position or layer is not valid. EBPO_E_LIMIT:
 * EBPO_PAINT_NOTES notes exist.
 *
 * Threads: one at a time per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_add_note(ebpo_paint *paint,
                                                       const ebpo_paint_note *note,
                                                       ebpo_error *error);

/*
 * Removes note `number`. The indices of later notes decrease by one.
 *
 * Threads: one at a time per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_remove_note(ebpo_paint *paint, uint64_t number,
                                                          ebpo_error *error);

/* ---- strokes ---- */

/* Effect of a stroke. */
typedef enum ebpo_paint_kind {
    EBPO_PAINT_PAINTS = 0,
    EBPO_PAINT_ERASES = 1 /* removes the paint of earlier strokes of its layer */
} ebpo_paint_kind;

/* A stroke. Arguments are copied. */
typedef struct ebpo_paint_stroke {
    size_t struct_size; /* EBPO_PAINT_STROKE_INIT sets it */

    uint64_t layer;       /* index of the layer */
    ebpo_paint_kind kind; /* effect of the stroke */

    /* Colour 0xRRGGBBAA: sRGB and opacity; 0 for an erasing stroke. */
    uint32_t colour;

    /* Radius of the balls of points of full size, in the model's unit: 2^-200 to 2^200. */
    double radius;

    /* Time in milliseconds since 1970-01-01 UTC, at most 2^53; 0: unknown. */
    uint64_t time;

    /* Number of points, at least 1, and the points in their order. */
    uint64_t point_count;
    const ebpo_paint_point *points;
} ebpo_paint_stroke;

#define EBPO_PAINT_STROKE_INIT EBPO_SIZED(ebpo_paint_stroke)

/*
 * Gets stroke `number`, 0 to stroke_count - 1, in the order in which strokes were added.
 * EBPO_E_ARGUMENT: the number is out of range.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_paint_get_stroke(const ebpo_paint *paint, uint64_t number,
                                           ebpo_paint_stroke *out);

/*
 * Adds a stroke, which covers earlier strokes. EBPO_E_ARGUMENT: a member is not valid.
 * EBPO_E_LIMIT: EBPO_PAINT_STROKES strokes or EBPO_PAINT_POINTS points exist.
 *
 * Threads: one at a time per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_add_stroke(ebpo_paint *paint,
                                                         const ebpo_paint_stroke *stroke,
                                                         ebpo_error *error);

/*
 * Removes stroke `number`. The indices of later strokes decrease by one. Removing the last stroke
 * undoes it.
 *
 * Threads: one at a time per paint.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_remove_stroke(ebpo_paint *paint, uint64_t number,
                                                            ebpo_error *error);

/* ---- a pen ---- */

/* One position of the device that draws, such as a haptic device, with pressure and time. */
typedef struct ebpo_paint_input {
    /* Position, in the model's coordinates. */
    double place[3];

    /* Pressure of the pen, 0 to 1. 0: the pen does not paint. */
    double pressure;

    /* Time since the first position, in milliseconds, at most 2^32 - 1. */
    double time;
} ebpo_paint_input;

/* Properties of the strokes that ebpo_paint_draw makes. */
typedef struct ebpo_paint_pen {
    size_t struct_size;

    /* Index of the layer, kind and colour of the strokes, as in ebpo_paint_stroke. */
    uint64_t layer;
    ebpo_paint_kind kind;
    uint32_t colour;

    /* Radius of points of full size, as in ebpo_paint_stroke. */
    double radius;

    /*
     * Maximum distance of points from the *foot* of the pen, which is the point of the surface
     * nearest to the device. In the model's unit, 0 to 2^200. Points are on the part of the surface
     * that is within this distance and connected to the foot. 0: all points are at the foot.
     */
    double spread;

    /*
     * Number of points of a step along the path (see `step`) at full pressure, 1 to 10,000. At
     * pressure p, a step has p * density points, rounded, but at least one point. If `spread` is 0,
     * this number must be 1.
     */
    uint32_t density;

    uint32_t reserved;

    /*
     * Sizes of points at pressure 0 (size_least) and at pressure 1 (size_full), as shares of the
     * radius, 2^-15 to 1. Sizes at other pressures are interpolated linearly.
     */
    double size_least, size_full;

    /*
     * Length of a step: distance along the path between two positions at which points are made. In
     * the model's unit, at least 2^-200. 0: half of the larger of `radius` and `spread`.
     */
    double step;

    /*
     * The pen is lifted while the device is farther from the surface than this distance. In the
     * model's unit; at least 0. INFINITY: the pen is never lifted.
     */
    double within;

    /* Seed for the positions of points. */
    uint64_t seed;

    /* Time of all strokes, as in ebpo_paint_stroke. */
    uint64_t time;

    ebpo_progress progress;

    /*
     * Above 0: the pen also paints at a position of the input if the pressure there is greater by
     * at least this value, 2^-15 to 1, than where the pen painted last. So a pen that presses
     * harder at one position paints a larger disc. 0: the pen paints only at each step.
     */
    double pressure_step;
} ebpo_paint_pen;

#define EBPO_PAINT_PEN_INIT                                                            \
    {                                                                                  \
        sizeof(ebpo_paint_pen), 0, EBPO_PAINT_PAINTS, 0xd62728ff, 0, 0, 1, 0, 1, 1, 0, \
            __builtin_inf(), 1, 0, { NULL, NULL }, 0                                   \
    }

/* Statistics of ebpo_paint_draw. */
typedef struct ebpo_paint_drawn {
    size_t struct_size;

    /*
     * strokes: number of strokes. points: number of their points. steps: number of steps that
     * painted. lifted: number of steps with the pen lifted.
     */
    uint64_t strokes, points, steps, lifted;

    /*
     * Number of points that were discarded: points that were farther than `spread` from the foot,
     * or on a part of the surface that is not connected to the foot.
     */
    uint64_t strayed;
} ebpo_paint_drawn;

#define EBPO_PAINT_DRAWN_INIT EBPO_SIZED(ebpo_paint_drawn)

/*
 * Converts the path of a device to strokes, with a new stroke after each lift of the pen. The path
 * is straight between two positions of the input. At each step along the path, the pen paints at
 * the nearest point of the surface. More pressure gives more points. Equal inputs and seeds give
 * equal points.
 *
 * context   context of a matching model (ebpo_paint_check_model)
 * input     [count] positions of the device, at least 1
 * drawn     receives statistics; may be NULL
 *
 * On failure no stroke is added. EBPO_E_ARGUMENT: a value is not valid, or the model does not
 * match. EBPO_E_ABSENT: the model is a subset that omits faces around the pen. EBPO_E_LIMIT: the
 * budget is too small (ebpo_model_new), or there are too many steps between two positions of the
 * input. Also the errors of reading (base.h).
 *
 * Threads: one at a time per paint and per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_draw(ebpo_paint *paint, ebpo_context *context,
                                                   const ebpo_paint_input *input, uint64_t count,
                                                   const ebpo_paint_pen *pen,
                                                   ebpo_paint_drawn *drawn, ebpo_error *error);

/* A pen whose positions arrive in several calls. */
typedef struct ebpo_paint_drawing ebpo_paint_drawing;

/*
 * Begins to draw with a pen. Until the drawing is freed, only ebpo_paint_drawing_add may change the
 * paint, and the paint and the context must exist.
 *
 * pen   is copied; its `progress` is called by ebpo_paint_drawing_add
 *
 * EBPO_E_ARGUMENT: a value is not valid, or the model does not match.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_drawing_new(ebpo_paint *paint, ebpo_context *context,
                                                          const ebpo_paint_pen *pen,
                                                          ebpo_paint_drawing **out,
                                                          ebpo_error *error);

/*
 * Continues the path of the pen with more positions, and adds points to the last stroke, or new
 * strokes. All calls together make the same strokes as one call of ebpo_paint_draw with all
 * positions.
 *
 * input   [count] next positions of the device, at least 1
 * drawn   receives statistics of all calls of this drawing; may be NULL
 *
 * On failure this call adds no points, and the next call begins a new stroke. Errors are those of
 * ebpo_paint_draw.
 *
 * Threads: one at a time per paint and per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_drawing_add(ebpo_paint_drawing *drawing,
                                                          const ebpo_paint_input *input,
                                                          uint64_t count, ebpo_paint_drawn *drawn,
                                                          ebpo_error *error);

/*
 * Ends the drawing. Its strokes stay in the paint.
 *
 * Threads: one at a time per drawing.
 */
EBPO_API void ebpo_paint_drawing_free(ebpo_paint_drawing *drawing);

/*
 * Finds the point of the surface nearest to a position, for notes and for pens of the caller. The
 * point has full size, pressure 0 and time 0.
 *
 * Errors are those of ebpo_distance. EBPO_E_ARGUMENT: also if the model does not match.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_locate(const ebpo_paint *paint, ebpo_context *context,
                                                     const double place[3], ebpo_paint_point *out,
                                                     ebpo_error *error);

/* ---- results ---- */

/* Options for computing results. */
typedef struct ebpo_paint_options {
    size_t struct_size;

    /*
     * Accuracy of areas, 1 to 65,536. A part of a face that is partly covered is halved until its
     * longest edge is at most r / fineness. Here r is the least radius of the balls that intersect
     * this part. With 256, the bounds of the area of a disc are within 1 % of the area, and `value`
     * is within 0.1 %.
     */
    unsigned fineness;

    /* Number of threads for ebpo_paint_measure and ebpo_paint_bake. 0: all cores. */
    unsigned threads;

    ebpo_progress progress;
} ebpo_paint_options;

#define EBPO_PAINT_OPTIONS_INIT                            \
    {                                                      \
        sizeof(ebpo_paint_options), 256, 0, { NULL, NULL } \
    }

/* A face that intersects the ball of a point of a stroke; valid until the callback returns. */
typedef struct ebpo_paint_face {
    /* face: index as in ebpo_distance_result. file_face: index in the file. */
    uint64_t face, file_face;

    /* Coordinates of the three corners, as stored in the file. */
    double corner[3][3];

    /*
     * For each corner, 1: the corner is covered; 0: the corner is not covered. A face without
     * covered corners may be covered in its middle.
     */
    uint8_t covered[3];

    uint8_t reserved[5];
} ebpo_paint_face;

/* Callback that gets a face. The callback returns false to stop the call. */
typedef bool (*ebpo_paint_face_fn)(void *user, const ebpo_paint_face *face);

/*
 * Passes to `take` each face that intersects the ball of a point of the stroke, and states which
 * corners of the face are covered. Each face is passed once, in the order of the file. Memory of
 * this function, ebpo_paint_bake and ebpo_paint_measure: 110 bytes for each such face. While the
 * ball of a point is processed, also 300 bytes for each face that intersects the box around this
 * ball.
 *
 * context                 context of a matching model (ebpo_paint_check_model)
 * points_outside_subset   receives the number of points whose faces are missing in the subset; may
 *                         be NULL
 *
 * EBPO_E_ARGUMENT: the model does not match. EBPO_E_FORMAT: a point is not on its face.
 * EBPO_E_UNSUPPORTED: the model's coordinates are beyond 2^200. EBPO_E_LIMIT: a point's ball
 * intersects more than 2^28 faces. EBPO_E_ABSENT. Also the errors of reading (base.h).
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_cover(const ebpo_paint *paint, ebpo_context *context,
                                                    uint64_t stroke, ebpo_paint_face_fn take,
                                                    void *user, uint64_t *points_outside_subset,
                                                    ebpo_error *error);

/* Statistics of ebpo_paint_bake. */
typedef struct ebpo_paint_baked {
    size_t struct_size;

    /*
     * Number of vertices that strokes of visible layers cover, including vertices whose paint a
     * later stroke erases.
     */
    uint64_t vertices;

    /*
     * points: number of points of visible layers. points_outside_subset: number of these points
     * whose faces are missing in the subset. points_without_vertex: number of these points that
     * cover no vertex, because their balls are smaller than the faces.
     */
    uint64_t points, points_outside_subset, points_without_vertex;
} ebpo_paint_baked;

#define EBPO_PAINT_BAKED_INIT EBPO_SIZED(ebpo_paint_baked)

/*
 * Applies the visible layers to the colours of vertices.
 *
 * context   context of a matching model (ebpo_paint_check_model)
 * mesh      mesh of that model, with faces, from ebpo_file_read_source_mesh
 * rgba      [vertex_count][4] in the order of the mesh. Input: the colours of the model. Output:
 *           the new colours; alpha and the colours of uncovered vertices are unchanged
 * baked     receives statistics; may be NULL
 *
 * Memory besides the mesh: 4 bytes per vertex, and 72 bytes per covered vertex. If the mesh lacks
 * some faces of the source, also 4 bytes per face.
 *
 * Errors are those of ebpo_paint_cover. EBPO_E_ARGUMENT: also if the mesh does not match.
 * EBPO_E_CANCELLED. On failure the colours are unchanged.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_bake(const ebpo_paint *paint, ebpo_context *context,
                                                   const ebpo_mesh *mesh,
                                                   const ebpo_paint_options *options, uint8_t *rgba,
                                                   ebpo_paint_baked *baked, ebpo_error *error);

/*
 * Sets the colours of those vertices of a mesh whose colours in `rgba` differ from their current
 * colours (ebpo_mesh_colours). The attributes red, green and blue (or diffuse_red, diffuse_green
 * and diffuse_blue) are set and keep their types; a value of type int8 is at most 127. A mesh
 * without these attributes gets red, green and blue as uint8, for all vertices. All other data is
 * unchanged.
 *
 * rgba   [vertex_count][4] new colours; alpha is ignored
 *
 * EBPO_E_ARGUMENT: the mesh has the maximum number of attributes.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_colour_mesh(ebpo_mesh *mesh, const uint8_t *rgba,
                                                          ebpo_error *error);

/*
 * An area, in square units of the model. `lo` and `hi` are bounds of the area, except for the
 * rounding of sums (2^-40 of the area). `value` is an estimate.
 */
typedef struct ebpo_paint_area {
    double lo, value, hi;
} ebpo_paint_area;

/* Area of one colour in one layer. */
typedef struct ebpo_paint_colour_area {
    uint64_t layer;  /* index of the layer */
    uint32_t colour; /* 0xRRGGBBAA */
    uint32_t reserved;
    ebpo_paint_area area;
} ebpo_paint_colour_area;

/* Result of ebpo_paint_measure. */
typedef struct ebpo_paint_areas {
    size_t struct_size;

    /* Area that is painted in at least one layer. */
    ebpo_paint_area all;

    /*
     * layers: [layer_count] area of each layer. strokes: [stroke_count] area of each stroke; 0 for
     * erasing strokes
     */
    ebpo_paint_area *layers, *strokes;

    /* [colour_count] area of each colour in each layer, sorted by layer, then by colour */
    uint64_t colour_count;
    ebpo_paint_colour_area *colours;

    /*
     * faces: number of faces that intersect balls of points. points_outside_subset: number of
     * points whose faces are missing in the subset.
     */
    uint64_t faces, points_outside_subset;
} ebpo_paint_areas;

#define EBPO_PAINT_AREAS_INIT EBPO_SIZED(ebpo_paint_areas)

/*
 * Measures the painted area. Invisible layers count too, and opacity does not matter. If strokes of
 * one layer overlap, the overlap counts only for the last of these strokes.
 *
 * out   freed by ebpo_paint_areas_free
 *
 * Memory: 24 bytes for each pair of a face and a point whose ball intersects the face, and 80 bytes
 * for each face in such a pair.
 *
 * Errors are those of ebpo_paint_cover. EBPO_E_ARGUMENT: also if the fineness is not valid.
 * EBPO_E_CANCELLED.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_paint_measure(const ebpo_paint *paint,
                                                      ebpo_context *context,
                                                      const ebpo_paint_options *options,
                                                      ebpo_paint_areas *out, ebpo_error *error);

/*
 * Frees the arrays and clears the struct, except its size.
 *
 * Threads: one at a time per struct.
 */
EBPO_API void ebpo_paint_areas_free(ebpo_paint_areas *areas);

#ifdef __cplusplus
}
#endif
#endif
