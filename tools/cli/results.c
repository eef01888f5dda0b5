#include "cli/results.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/numbers.h"

const char *const where_words[] = { "OUT", "IN", "ON", "MAYBE" };

/* --- components of a result: each function writes at `at`, and returns the end of its text --- */

static inline char *put_text(char *at, const char *text)
{
    size_t length = strlen(text);
    memcpy(at, text, length);
    return at + length;
}

static inline char *put_u64(char *at, uint64_t v)
{
    for (int i = 0; i < 8; i++)
        at[i] = (char)(v >> 8 * i);
    return at + 8;
}

static inline char *put_double(char *at, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    return put_u64(at, bits);
}

/* Returns the separator of the numbers in a line. */
static inline char separator_of(result_form form) { return form == RESULTS_CSV ? ',' : ' '; }

static char *put_json_real(char *at, const char *lead, double v)
{
    at = put_text(at, lead);
    return isfinite(v) ? number_write(at, v) : put_text(at, "null");
}

static char *put_json_reals(char *at, const char *lead, const double v[3])
{
    at = put_json_real(at, lead, v[0]);
    at = put_json_real(at, ", ", v[1]);
    at = put_json_real(at, ", ", v[2]);
    return put_text(at, "]");
}

/* Ends the results of an input row. */
static void end_row(result_text *t, result_form form, char *at)
{
    if (form != RESULTS_RAW)
        *at++ = '\n';
    result_text_end(t, at);
    result_text_end_row(t);
}

void raw_u64(FILE *out, uint64_t v)
{
    char b[8];
    put_u64(b, v);
    fwrite(b, 1, sizeof b, out);
}

void raw_double(FILE *out, double v)
{
    char b[8];
    put_double(b, v);
    fwrite(b, 1, sizeof b, out);
}

/* --- attributes: written after the face index --- */

/* Writes the attributes of a face at a point. If `face` is EBPO_NO_FACE, the values are written as
 * missing. ebpo_sample should not fail, because the sampler was made for the file of the queries.
 * If it fails, the values are also written as missing. */
static char *put_attributes(char *at, result_form form, const ebpo_sampler *sampler,
                            const double point[3], uint64_t face)
{
    double values[EBPO_SAMPLER_MAX];
    ebpo_error error = EBPO_ERROR_INIT;
    unsigned count = sampler ? ebpo_sampler_columns(sampler) : 0;
    bool none = face == EBPO_NO_FACE; /* true: the values are written as missing */
    if (count && ebpo_sample(sampler, point, &face, 1, values, &error) != EBPO_OK)
        none = true;
    if (count && form == RESULTS_JSON)
        at = put_text(at, none ? ", \"attributes\": null" : ", \"attributes\": [");
    for (unsigned k = 0; k < count; k++)
        if (form == RESULTS_RAW)
            at = put_double(at, none ? (double)NAN : values[k]);
        else if (form == RESULTS_JSON)
            at = none ? at : put_json_real(at, k ? ", " : "", values[k]);
        else {
            *at++ = separator_of(form);
            at = none ? put_text(at, "-") : number_write(at, values[k]);
        }
    return count && form == RESULTS_JSON && !none ? put_text(at, "]") : at;
}

/* --- the model of a catalogue --- */

/* Writes the index of the model in the catalogue; UINT64_MAX: no model. If `model` is NULL, there
 * is no catalogue, and nothing is written. */
static char *put_model(char *at, result_form form, const uint64_t *model)
{
    if (!model)
        return at;
    if (form == RESULTS_RAW)
        return put_u64(at, *model);
    if (form == RESULTS_JSON)
        at = put_text(at, ", \"model\": ");
    else
        *at++ = separator_of(form);
    return *model != UINT64_MAX ? number_write_uint(at, *model)
                                : put_text(at, form == RESULTS_JSON ? "null" : "-");
}

/* --- inside --- */

static char *inside_json(char *at, const ebpo_inside_result *r)
{
    at = put_text(put_text(at, "{\"where\": \""), where_words[r->where]);
    at = number_write_int(put_text(at, "\", \"winding\": "), r->winding);
    if (r->where == EBPO_MAYBE)
        at = put_json_real(at, ", \"doubt\": ", r->doubt);
    return put_text(at, "}");
}

static char *inside_line(char *at, char between, const ebpo_inside_result *r)
{
    at = put_text(at, where_words[r->where]);
    *at++ = between;
    at = number_write_int(at, r->winding);
    if (r->where == EBPO_MAYBE) {
        *at++ = between;
        at = number_write(at, r->doubt);
    }
    return at;
}

void results_inside(result_text *t, result_form form, const ebpo_inside_result *results,
                    uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_inside_result *r = &results[i];
        char *at = result_text_capacity(t);
        if (form == RESULTS_RAW)
            at = put_u64(at, (uint64_t)(uint32_t)r->winding << 32 | (uint32_t)r->where);
        else
            at = form == RESULTS_JSON ? inside_json(at, r) : inside_line(at, separator_of(form), r);
        end_row(t, form, at);
    }
}

/* --- distance --- */

/* Returns true if there is a nearest point. The distance may be inf nevertheless, if it is beyond
 * the range of doubles. */
static bool has_point(const ebpo_distance_result *r)
{
    return isfinite(r->distance) || r->face != EBPO_NO_FACE;
}

static char *distance_json(char *at, const ebpo_distance_result *r)
{
    at = put_json_real(at, "{\"distance\": ", r->distance);
    if (has_point(r)) {
        at = put_json_reals(at, ", \"point\": [", r->point);
        at = put_json_reals(at, ", \"normal\": [", r->normal);
    } else {
        at = put_text(at, ", \"point\": null, \"normal\": null");
    }
    at = put_text(at, ", \"face\": ");
    return r->face == EBPO_NO_FACE ? put_text(at, "null") : number_write_uint(at, r->face);
}

static char *distance_line(char *at, char between, const ebpo_distance_result *r)
{
    at = number_write(at, r->distance);
    for (int k = 0; k < 6; k++) {
        *at++ = between;
        if (has_point(r))
            at = number_write(at, k < 3 ? r->point[k] : r->normal[k - 3]);
        else
            *at++ = '-';
    }
    *at++ = between;
    return r->face == EBPO_NO_FACE ? put_text(at, "-") : number_write_uint(at, r->face);
}

static char *distance_raw(char *at, const ebpo_distance_result *r)
{
    at = put_double(at, r->distance);
    for (int k = 0; k < 3; k++)
        at = put_double(at, r->point[k]);
    for (int k = 0; k < 3; k++)
        at = put_double(at, r->normal[k]);
    return put_u64(at, r->face);
}

static char *put_interval(char *at, result_form form, const ebpo_distance_result *r)
{
    if (form == RESULTS_RAW)
        return put_double(put_double(at, r->lo), r->hi);
    if (form == RESULTS_JSON)
        return put_text(put_json_real(put_json_real(at, "{\"lo\": ", r->lo), ", \"hi\": ", r->hi),
                        "}");
    at = number_write(at, r->lo);
    *at++ = separator_of(form);
    return number_write(at, r->hi);
}

static char *put_distance(char *at, result_form form, const ebpo_distance_result *r,
                          const ebpo_sampler *sampler, const uint64_t *model)
{
    at = form == RESULTS_RAW    ? distance_raw(at, r)
         : form == RESULTS_JSON ? distance_json(at, r)
                                : distance_line(at, separator_of(form), r);
    at = put_model(at, form, model);
    at = put_attributes(at, form, sampler, r->point, r->face);
    return form == RESULTS_JSON ? put_text(at, "}") : at;
}

void results_distance(result_text *t, result_form form, bool intervals,
                      const ebpo_distance_result *results, uint64_t count,
                      const ebpo_sampler *sampler, const uint64_t *model)
{
    for (uint64_t i = 0; i < count; i++) {
        char *at = result_text_capacity(t);
        at = intervals ? put_interval(at, form, &results[i])
                       : put_distance(at, form, &results[i], sampler, model ? &model[i] : NULL);
        end_row(t, form, at);
    }
}

/* --- the nearest faces: the number of faces is known only at the end --- */

void results_near(result_text *t, result_form form, const ebpo_near_face *face, bool first,
                  const ebpo_sampler *sampler)
{
    ebpo_distance_result r = { .distance = face->distance, .face = face->face };
    char *at = result_text_capacity(t);
    memcpy(r.point, face->point, sizeof r.point);
    memcpy(r.normal, face->normal, sizeof r.normal);
    if (form == RESULTS_JSON)
        at = put_text(at, first ? "[" : ", ");
    at = put_distance(at, form, &r, sampler, NULL);
    bool line = form == RESULTS_TEXT || form == RESULTS_CSV;
    result_text_end(t, put_text(at, line ? "\n" : ""));
    if (line) /* JSON and raw lists stay buffered until they are complete or too long */
        result_text_close(t);
}

void results_near_end(result_text *t, result_form form, bool none, const ebpo_sampler *sampler)
{
    static const ebpo_distance_result nothing = { .distance = INFINITY,
                                                  .point = { NAN, NAN, NAN },
                                                  .face = EBPO_NO_FACE };
    char *at = result_text_capacity(t);
    if (form == RESULTS_RAW)
        at = put_distance(at, form, &nothing, sampler, NULL);
    else if (form == RESULTS_JSON)
        at = put_text(at, none ? "[]" : "]");
    end_row(t, form, at);
}

/* --- rays and boxes --- */

static char *put_hit(char *at, result_form form, const ebpo_ray_hit *hit)
{
    if (form == RESULTS_RAW)
        return put_u64(put_u64(put_double(at, hit->t), hit->face), (uint64_t)(int64_t)hit->side);
    bool json = form == RESULTS_JSON;
    char lead[2] = { json ? 0 : separator_of(form), 0 };
    at = json ? put_json_real(at, "{\"t\": ", hit->t) : number_write(at, hit->t);
    at = number_write_uint(put_text(at, json ? ", \"face\": " : lead), hit->face);
    return number_write_int(put_text(at, json ? ", \"side\": " : lead), hit->side);
}

/* Writes a hit with the attributes at its point. If t is beyond the range of doubles (inf), the
 * attributes are missing. */
static char *put_found(char *at, result_form form, const ebpo_ray *ray, const ebpo_ray_hit *hit,
                       const ebpo_sampler *sampler, const uint64_t *model)
{
    double point[3];
    for (int k = 0; k < 3; k++)
        point[k] = fmax(-DBL_MAX, fmin(ray->origin[k] + hit->t * ray->direction[k], DBL_MAX));
    at = put_model(put_hit(at, form, hit), form, model);
    at = put_attributes(at, form, sampler, point, isfinite(hit->t) ? hit->face : EBPO_NO_FACE);
    return put_text(at, form == RESULTS_JSON ? "}" : "");
}

void results_ray_first(result_text *t, result_form form, const ebpo_ray *rays,
                       const ebpo_ray_hit *hits, uint64_t count, const ebpo_sampler *sampler,
                       const uint64_t *model)
{
    static const char *const nothing[] = { "-", "null", "", "-,-,-" };
    for (uint64_t i = 0; i < count; i++) {
        bool none = hits[i].face == EBPO_NO_FACE && form != RESULTS_RAW;
        char *at = result_text_capacity(t);
        if (!none)
            at = put_found(at, form, &rays[i], &hits[i], sampler, model ? &model[i] : NULL);
        else
            at = put_text(at, nothing[form]);
        if (none && form == RESULTS_CSV && model)
            at = put_model(at, form, &model[i]);
        if (none && form == RESULTS_CSV)
            at = put_attributes(at, form, sampler, rays[i].origin, EBPO_NO_FACE);
        end_row(t, form, at);
    }
}

void results_ray_any(result_text *t, result_form form, const bool *any, uint64_t count)
{
    static const char *const words[2][2] = { { "no", "yes" }, { "false", "true" } };
    for (uint64_t i = 0; i < count; i++) {
        char *at = result_text_capacity(t);
        end_row(t, form,
                form == RESULTS_RAW ? put_u64(at, any[i])
                                    : put_text(at, words[form == RESULTS_JSON][any[i]]));
    }
}

/* Writes the text before a list of `count` items. */
static void begin_list(result_text *t, result_form form, uint64_t count)
{
    char *at = result_text_capacity(t);
    result_text_end(t, form == RESULTS_RAW    ? put_u64(at, count)
                       : form == RESULTS_JSON ? put_text(at, "[")
                                              : number_write_uint(at, count));
}

/* Writes the text after a list. */
static void end_list(result_text *t, result_form form)
{
    end_row(t, form, put_text(result_text_capacity(t), form == RESULTS_JSON ? "]" : ""));
}

/* Writes the separator before the next item of a list. Returns the position of the item. */
static char *next_item(result_text *t, result_form form, bool first)
{
    char *at = result_text_capacity(t);
    if (form == RESULTS_JSON)
        return put_text(at, first ? "" : ", ");
    if (form != RESULTS_RAW)
        *at++ = separator_of(form);
    return at;
}

void results_ray_all(result_text *t, result_form form, const ebpo_ray *ray,
                     const ebpo_ray_hit *hits, uint64_t count, const ebpo_sampler *sampler)
{
    begin_list(t, form, count);
    for (uint64_t i = 0; i < count; i++)
        result_text_end(t,
                        put_found(next_item(t, form, i == 0), form, ray, &hits[i], sampler, NULL));
    end_list(t, form);
}

void results_box(result_text *t, result_form form, const uint64_t *faces, uint64_t count)
{
    begin_list(t, form, count);
    for (uint64_t i = 0; i < count; i++) {
        char *at = next_item(t, form, i == 0);
        result_text_end(t, form == RESULTS_RAW ? put_u64(at, faces[i])
                                               : number_write_uint(at, faces[i]));
    }
    end_list(t, form);
}

/* --- names of columns --- */

static char *put_names(char *at, result_form form, const char *names)
{
    for (; *names; names++)
        *at++ = *names == ',' ? separator_of(form) : *names;
    return at;
}

void results_header(result_text *t, result_form form, const char *names, const char *attributes)
{
    char *at = put_names(result_text_capacity(t), form, names);
    if (attributes) {
        *at++ = separator_of(form);
        at = put_names(at, form, attributes);
    }
    end_row(t, form, at);
}
