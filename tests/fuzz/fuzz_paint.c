/* Fuzz target: any bytes as a paint file. A resulting paint keeps every limit of
 * format-spec/paint.md, and can be changed and emptied. Tests build it twice, as fuzz_head.c. */
#include "fuzz_support.h"

#include <math.h>

#include <ebpo/paint.h>

static ebpo_paint *parse(const uint8_t *data, size_t size)
{
    ebpo_paint *paint = NULL;
    ebpo_error error = EBPO_ERROR_INIT;
    uint8_t *copy = fuzz_copy(data, size);
    ebpo_status status = ebpo_paint_open_memory(copy, size, "fuzz.paint.h5", &paint, &error);
    free(copy); /* it is not needed any more */
    fuzz_must((status == EBPO_OK) == (paint != NULL));
    fuzz_must(status == EBPO_OK || (error.status == status && error.message[0]));
    return paint;
}

static void check_point(const ebpo_paint_point *q)
{
    for (int i = 0; i < 3; i++)
        fuzz_must(fabs(q->place[i]) <= 0x1p200);
    fuzz_must(q->face != UINT32_MAX && q->size >= 1 && q->size <= 1 << 15);
    fuzz_must((uint64_t)q->weight[0] + q->weight[1] <= 1 << 30);
}

static void check_layers(const ebpo_paint *paint, const ebpo_paint_info *info)
{
    ebpo_paint_layer l = EBPO_PAINT_LAYER_INIT;
    ebpo_paint_note n = EBPO_PAINT_NOTE_INIT;
    for (uint64_t i = 0; i < info->layer_count; i++) {
        fuzz_must(ebpo_paint_get_layer(paint, i, &l) == EBPO_OK);
        fuzz_must(strlen(l.title) <= 255 && strlen(l.author) <= 255 && strlen(l.date) <= 31);
        fuzz_must(strlen(l.description) <= 4095 && l.opacity <= 255 && l.visible <= 1);
    }
    for (uint64_t i = 0; i < info->note_count; i++) {
        fuzz_must(ebpo_paint_get_note(paint, i, &n) == EBPO_OK);
        fuzz_must(strlen(n.title) <= 255 && strlen(n.body) <= 32767 && n.layer < info->layer_count);
        check_point(&n.at);
    }
    fuzz_must(ebpo_paint_get_layer(paint, info->layer_count, &l) != EBPO_OK);
    fuzz_must(ebpo_paint_get_note(paint, info->note_count, &n) != EBPO_OK);
}

static void check_strokes(const ebpo_paint *paint, const ebpo_paint_info *info)
{
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    uint64_t points = 0;
    for (uint64_t i = 0; i < info->stroke_count; i++) {
        fuzz_must(ebpo_paint_get_stroke(paint, i, &s) == EBPO_OK);
        fuzz_must(s.layer < info->layer_count && s.point_count > 0);
        fuzz_must(s.kind == EBPO_PAINT_PAINTS || (s.kind == EBPO_PAINT_ERASES && s.colour == 0));
        fuzz_must(s.radius >= 0x1p-200 && s.radius <= 0x1p200);
        for (uint64_t k = 0; k < s.point_count; k++)
            check_point(&s.points[k]);
        points += s.point_count;
    }
    fuzz_must(points == info->point_count);
}

static void take_apart(ebpo_paint *paint, const ebpo_paint_info *info)
{
    ebpo_paint_info now = EBPO_PAINT_INFO_INIT;
    for (uint64_t i = 0; i < info->stroke_count && i < 4; i++)
        fuzz_must(ebpo_paint_remove_stroke(paint, (info->stroke_count - 1 - i) / 2, NULL) ==
                  EBPO_OK);
    for (uint64_t i = info->layer_count; i-- > 0;)
        fuzz_must(ebpo_paint_remove_layer(paint, i, NULL) == EBPO_OK);
    fuzz_must(ebpo_paint_get_info(paint, &now) == EBPO_OK);
    fuzz_must(now.point_count == 0 && now.stroke_count == 0 && now.note_count == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint *paint = parse(data, size);
    if (!paint)
        return 0;
    fuzz_must(ebpo_paint_get_info(paint, &info) == EBPO_OK);
    fuzz_must(strlen(info.model_sha256) == 64 && strlen(info.generator) <= 63);
    check_layers(paint, &info);
    check_strokes(paint, &info);
    take_apart(paint, &info);
    ebpo_paint_free(paint);
    return 0;
}
