#include "cli/answers.h"

#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio_ext.h>
#include <string.h>

#include "cli/command.h"

const char *const where_words[] = { "OUT", "IN", "ON", "MAYBE" };

/* --- answers leave whole --- */

/* A pipe takes so much at once; the last answer under it leaves before the next one begins. ANSWER:
 * the longest one, but for lists of hits and faces. */
enum { CHUNK = 4096, ANSWER = 512 };

static const char *printing; /* the command */

void answers_begin(const char *name)
{
    printing = name;
    setvbuf(stdout, NULL, _IOFBF, 1 << 18);
}

static void leave_whole(void)
{
    if (__fpending(stdout) > CHUNK - ANSWER)
        /* a failure stays with the stream: the loop of questions sees it */
        command_flush(printing);
}

/* --- raw --- */

void raw_u64(FILE *out, uint64_t v)
{
    uint8_t b[8];
    for (int i = 0; i < 8; i++)
        b[i] = (uint8_t)(v >> 8 * i);
    fwrite(b, 1, sizeof b, out);
}

void raw_double(FILE *out, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    raw_u64(out, bits);
}

static void raw_doubles(const double *v, int count)
{
    for (int i = 0; i < count; i++)
        raw_double(stdout, v[i]);
}

/* --- JSON lines --- */

static void compact_real(const char *lead, double v)
{
    if (isfinite(v))
        printf("%s%.17g", lead, v);
    else
        printf("%snull", lead);
}

static void compact_reals(const char *lead, const double v[3])
{
    compact_real(lead, v[0]);
    compact_real(", ", v[1]);
    compact_real(", ", v[2]);
    putchar(']');
}

/* --- inside --- */

static void inside_json(const ebpo_inside_result *r)
{
    printf("{\"where\": \"%s\", \"winding\": %" PRId32, where_words[r->where], r->winding);
    if (r->where == EBPO_MAYBE)
        compact_real(", \"doubt\": ", r->doubt);
    puts("}");
}

static void inside_text(const ebpo_inside_result *r)
{
    printf("%s %" PRId32, where_words[r->where], r->winding);
    if (r->where == EBPO_MAYBE)
        printf(" %.17g", r->doubt);
    putchar('\n');
}

void answers_inside(answer_form form, const ebpo_inside_result *results, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_inside_result *r = &results[i];
        if (form == ANSWERS_RAW)
            raw_u64(stdout, (uint64_t)(uint32_t)r->winding << 32 | (uint32_t)r->where);
        else if (form == ANSWERS_JSON)
            inside_json(r);
        else
            inside_text(r);
        leave_whole();
    }
}

/* --- distance --- */

static void distance_json(bool limited, const ebpo_distance_result *r)
{
    if (limited) {
        compact_real("{\"lo\": ", r->lo);
        compact_real(", \"hi\": ", r->hi);
        putchar('}');
        return;
    }
    compact_real("{\"distance\": ", r->distance);
    if (isfinite(r->distance)) {
        compact_reals(", \"point\": [", r->point);
        compact_reals(", \"normal\": [", r->normal);
    } else {
        fputs(", \"point\": null, \"normal\": null", stdout);
    }
    if (r->face == EBPO_NO_FACE)
        fputs(", \"face\": null}", stdout);
    else
        printf(", \"face\": %" PRIu64 "}", r->face);
}

static void distance_text(bool limited, const ebpo_distance_result *r)
{
    if (limited) {
        printf("%.17g %.17g", r->lo, r->hi);
        return;
    }
    printf("%.17g", r->distance);
    for (int k = 0; k < 6; k++)
        if (isfinite(r->distance))
            printf(" %.17g", k < 3 ? r->point[k] : r->normal[k - 3]);
        else
            fputs(" -", stdout);
    if (r->face == EBPO_NO_FACE)
        fputs(" -", stdout);
    else
        printf(" %" PRIu64, r->face);
}

static void distance_raw(bool limited, const ebpo_distance_result *r)
{
    if (limited) {
        raw_double(stdout, r->lo);
        raw_double(stdout, r->hi);
        return;
    }
    raw_double(stdout, r->distance);
    raw_doubles(r->point, 3);
    raw_doubles(r->normal, 3);
    raw_u64(stdout, r->face);
}

static void put_distance(answer_form form, bool limited, const ebpo_distance_result *r)
{
    (form == ANSWERS_RAW    ? distance_raw
     : form == ANSWERS_JSON ? distance_json
                            : distance_text)(limited, r);
}

void answers_distance(answer_form form, bool limited, const ebpo_distance_result *results,
                      uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        put_distance(form, limited, &results[i]);
        if (form != ANSWERS_RAW)
            putchar('\n');
        leave_whole();
    }
}

/* --- the nearest faces: their number is known at the end only --- */

void answers_near(answer_form form, const ebpo_near_face *face, bool first)
{
    ebpo_distance_result r = { .distance = face->distance, .face = face->face };
    memcpy(r.point, face->point, sizeof r.point);
    memcpy(r.normal, face->normal, sizeof r.normal);
    if (form == ANSWERS_JSON)
        fputs(first ? "[" : ", ", stdout);
    put_distance(form, false, &r);
    if (form == ANSWERS_TEXT) {
        putchar('\n');
        leave_whole(); /* lists in JSON leave when they are whole, or too long for that */
    }
}

void answers_near_end(answer_form form, bool none)
{
    static const ebpo_distance_result nothing = { .distance = INFINITY,
                                                  .point = { NAN, NAN, NAN },
                                                  .face = EBPO_NO_FACE };
    if (form == ANSWERS_RAW)
        distance_raw(false, &nothing);
    else if (form == ANSWERS_JSON)
        puts(none ? "[]" : "]");
    else
        putchar('\n');
    leave_whole();
}

/* --- rays and boxes --- */

static void hit_json(const char *lead, const ebpo_ray_hit *hit)
{
    printf("%s{\"t\": %.17g, \"face\": %" PRIu64 ", \"side\": %" PRId32 "}", lead, hit->t,
           hit->face, hit->side);
}

static void hit_raw(const ebpo_ray_hit *hit)
{
    raw_double(stdout, hit->t);
    raw_u64(stdout, hit->face);
    raw_u64(stdout, (uint64_t)(int64_t)hit->side);
}

static void hit_text(const ebpo_ray_hit *hit)
{
    printf("%.17g %" PRIu64 " %" PRId32, hit->t, hit->face, hit->side);
}

void answers_ray_first(answer_form form, const ebpo_ray_hit *hits, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        bool none = hits[i].face == EBPO_NO_FACE;
        if (form == ANSWERS_RAW)
            hit_raw(&hits[i]);
        else if (none)
            fputs(form == ANSWERS_JSON ? "null" : "-", stdout);
        else if (form == ANSWERS_JSON)
            hit_json("", &hits[i]);
        else
            hit_text(&hits[i]);
        if (form != ANSWERS_RAW)
            putchar('\n');
        leave_whole();
    }
}

void answers_ray_any(answer_form form, const bool *any, uint64_t count)
{
    static const char *const words[2][2] = { { "no", "yes" }, { "false", "true" } };
    for (uint64_t i = 0; i < count; i++) {
        if (form == ANSWERS_RAW)
            raw_u64(stdout, any[i]);
        else
            puts(words[form == ANSWERS_JSON][any[i]]);
        leave_whole();
    }
}

/* Of an answer that is a list: what is before it, and after it. */
static void begin_list(answer_form form, uint64_t count)
{
    if (form == ANSWERS_RAW)
        raw_u64(stdout, count);
    else if (form == ANSWERS_JSON)
        putchar('[');
    else
        printf("%" PRIu64, count);
}

static void end_list(answer_form form)
{
    if (form != ANSWERS_RAW)
        puts(form == ANSWERS_JSON ? "]" : "");
    leave_whole();
}

void answers_ray_all(answer_form form, const ebpo_ray_hit *hits, uint64_t count)
{
    begin_list(form, count);
    for (uint64_t i = 0; i < count; i++)
        if (form == ANSWERS_RAW)
            hit_raw(&hits[i]);
        else if (form == ANSWERS_JSON)
            hit_json(i ? ", " : "", &hits[i]);
        else {
            putchar(' ');
            hit_text(&hits[i]);
        }
    end_list(form);
}

void answers_box(answer_form form, const uint64_t *faces, uint64_t count)
{
    begin_list(form, count);
    for (uint64_t i = 0; i < count; i++)
        if (form == ANSWERS_RAW)
            raw_u64(stdout, faces[i]);
        else
            printf("%s%" PRIu64, form == ANSWERS_JSON ? (i ? ", " : "") : " ", faces[i]);
    end_list(form);
}

/* --- sums --- */

static const struct sum {
    const char *name;
    size_t offset;
    enum { SUM_BOOL, SUM_INT, SUM_UINT, SUM_REAL, SUM_FIVE } kind;
} sums[] = {
    { "resident", offsetof(ebpo_model_stats, resident), SUM_BOOL },
    { "cut_level", offsetof(ebpo_model_stats, cut_level), SUM_INT },
    { "memory", offsetof(ebpo_model_stats, memory), SUM_UINT },
    { "memory_peak", offsetof(ebpo_model_stats, memory_peak), SUM_UINT },
    { "budget", offsetof(ebpo_model_stats, budget), SUM_UINT },
    { "hits", offsetof(ebpo_model_stats, hits), SUM_UINT },
    { "loads", offsetof(ebpo_model_stats, loads), SUM_UINT },
    { "prefetched", offsetof(ebpo_model_stats, prefetched), SUM_UINT },
    { "evicted", offsetof(ebpo_model_stats, evicted), SUM_UINT },
    { "bytes_read", offsetof(ebpo_model_stats, bytes_read), SUM_UINT },
    { "reads", offsetof(ebpo_model_stats, reads), SUM_UINT },
    { "open_seconds", offsetof(ebpo_model_stats, open_seconds), SUM_REAL },
    { "load_seconds", offsetof(ebpo_model_stats, load_seconds), SUM_REAL },
    { "leaves", offsetof(ebpo_model_stats, leaves), SUM_UINT },
    { "leaves_of_kind", offsetof(ebpo_model_stats, leaves_of_kind), SUM_FIVE },
    { "leaves_one_wall", offsetof(ebpo_model_stats, leaves_one_wall), SUM_UINT },
    { "distances", offsetof(ebpo_model_stats, distances), SUM_UINT },
    { "distance_subtrees", offsetof(ebpo_model_stats, distance_subtrees), SUM_UINT },
    { "distance_loads", offsetof(ebpo_model_stats, distance_loads), SUM_UINT },
    { "skeleton_bytes", offsetof(ebpo_model_stats, skeleton_bytes), SUM_UINT },
};
enum { SUMS = sizeof sums / sizeof *sums };

void stats_print(FILE *out, bool as_json, const ebpo_model_stats *stats)
{
    for (int i = 0; i < SUMS; i++) {
        const char *field = (const char *)stats + sums[i].offset;
        const uint64_t *u = (const void *)field;
        if (as_json)
            fprintf(out, "%s\"%s\": ", i ? ", " : "{", sums[i].name);
        else
            fprintf(out, "%s%s ", i ? ", " : "", sums[i].name);
        switch (sums[i].kind) {
        case SUM_BOOL:
            fputs(*(const bool *)field ? (as_json ? "true" : "yes") : (as_json ? "false" : "no"),
                  out);
            break;
        case SUM_INT: fprintf(out, "%d", *(const int *)(const void *)field); break;
        case SUM_UINT: fprintf(out, "%" PRIu64, *u); break;
        case SUM_REAL: fprintf(out, "%.6f", *(const double *)(const void *)field); break;
        case SUM_FIVE:
            fprintf(out,
                    as_json ? "[%" PRIu64 ", %" PRIu64 ", %" PRIu64 ", %" PRIu64 ", %" PRIu64 "]"
                            : "%" PRIu64 "/%" PRIu64 "/%" PRIu64 "/%" PRIu64 "/%" PRIu64,
                    u[0], u[1], u[2], u[3], u[4]);
        }
    }
    fputs(as_json ? "}\n" : "\n", out);
}

void stats_json(json *j, const char *key, const ebpo_model_stats *stats)
{
    json_object(j, key);
    for (int i = 0; i < SUMS; i++) {
        const char *field = (const char *)stats + sums[i].offset;
        switch (sums[i].kind) {
        case SUM_BOOL: json_bool(j, sums[i].name, *(const bool *)field); break;
        case SUM_INT: json_int(j, sums[i].name, *(const int *)(const void *)field); break;
        case SUM_UINT: json_uint(j, sums[i].name, *(const uint64_t *)(const void *)field); break;
        case SUM_REAL: json_real(j, sums[i].name, *(const double *)(const void *)field); break;
        case SUM_FIVE:
            json_array(j, sums[i].name);
            for (int k = 0; k < 5; k++)
                json_uint(j, NULL, ((const uint64_t *)(const void *)field)[k]);
            json_end(j);
        }
    }
    json_end(j);
}
