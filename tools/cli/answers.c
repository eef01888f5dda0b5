#include "cli/answers.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/numbers.h"

const char *const where_words[] = { "OUT", "IN", "ON", "MAYBE" };

/* --- pieces of an answer: each is put at `at`, and where it ends is returned --- */

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

/* Between the numbers of a line. */
static inline char separator_of(answer_form form) { return form == ANSWERS_CSV ? ',' : ' '; }

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

/* Ends the answer to a row of the input. */
static void end_row(answer_text *t, answer_form form, char *at)
{
    if (form != ANSWERS_RAW)
        *at++ = '\n';
    answer_text_end(t, at);
    answer_text_end_row(t);
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

/* --- attributes: behind the face that has them --- */

/* `face` may be none. The file that was asked has what is told of it, so that nothing can fail. */
static char *put_attributes(char *at, answer_form form, const ebpo_sampler *sampler,
                            const double point[3], uint64_t face)
{
    double values[EBPO_SAMPLER_MOST];
    ebpo_error error = EBPO_ERROR_INIT;
    unsigned count = sampler ? ebpo_sampler_columns(sampler) : 0;
    bool none = face == EBPO_NO_FACE;
    if (count && ebpo_sample(sampler, point, &face, 1, values, &error) != EBPO_OK)
        none = true;
    if (count && form == ANSWERS_JSON)
        at = put_text(at, none ? ", \"attributes\": null" : ", \"attributes\": [");
    for (unsigned k = 0; k < count; k++)
        if (form == ANSWERS_RAW)
            at = put_double(at, none ? (double)NAN : values[k]);
        else if (form == ANSWERS_JSON)
            at = none ? at : put_json_real(at, k ? ", " : "", values[k]);
        else {
            *at++ = separator_of(form);
            at = none ? put_text(at, "-") : number_write(at, values[k]);
        }
    return count && form == ANSWERS_JSON && !none ? put_text(at, "]") : at;
}

/* --- the model of a catalogue --- */

/* NULL: there is but one. UINT64_MAX: none. */
static char *put_model(char *at, answer_form form, const uint64_t *model)
{
    if (!model)
        return at;
    if (form == ANSWERS_RAW)
        return put_u64(at, *model);
    if (form == ANSWERS_JSON)
        at = put_text(at, ", \"model\": ");
    else
        *at++ = separator_of(form);
    return *model != UINT64_MAX ? number_write_uint(at, *model)
                                : put_text(at, form == ANSWERS_JSON ? "null" : "-");
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

void answers_inside(answer_text *t, answer_form form, const ebpo_inside_result *results,
                    uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_inside_result *r = &results[i];
        char *at = answer_text_room(t);
        if (form == ANSWERS_RAW)
            at = put_u64(at, (uint64_t)(uint32_t)r->winding << 32 | (uint32_t)r->where);
        else
            at = form == ANSWERS_JSON ? inside_json(at, r) : inside_line(at, separator_of(form), r);
        end_row(t, form, at);
    }
}

/* --- distance --- */

/* Returns true where there is a nearest point: also of a distance beyond doubles, which is inf. */
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

static char *put_limited(char *at, answer_form form, const ebpo_distance_result *r)
{
    if (form == ANSWERS_RAW)
        return put_double(put_double(at, r->lo), r->hi);
    if (form == ANSWERS_JSON)
        return put_text(put_json_real(put_json_real(at, "{\"lo\": ", r->lo), ", \"hi\": ", r->hi),
                        "}");
    at = number_write(at, r->lo);
    *at++ = separator_of(form);
    return number_write(at, r->hi);
}

static char *put_distance(char *at, answer_form form, const ebpo_distance_result *r,
                          const ebpo_sampler *sampler, const uint64_t *model)
{
    at = form == ANSWERS_RAW    ? distance_raw(at, r)
         : form == ANSWERS_JSON ? distance_json(at, r)
                                : distance_line(at, separator_of(form), r);
    at = put_model(at, form, model);
    at = put_attributes(at, form, sampler, r->point, r->face);
    return form == ANSWERS_JSON ? put_text(at, "}") : at;
}

void answers_distance(answer_text *t, answer_form form, bool limited,
                      const ebpo_distance_result *results, uint64_t count,
                      const ebpo_sampler *sampler, const uint64_t *model)
{
    for (uint64_t i = 0; i < count; i++) {
        char *at = answer_text_room(t);
        at = limited ? put_limited(at, form, &results[i])
                     : put_distance(at, form, &results[i], sampler, model ? &model[i] : NULL);
        end_row(t, form, at);
    }
}

/* --- the nearest faces: their number is known at the end only --- */

void answers_near(answer_text *t, answer_form form, const ebpo_near_face *face, bool first,
                  const ebpo_sampler *sampler)
{
    ebpo_distance_result r = { .distance = face->distance, .face = face->face };
    char *at = answer_text_room(t);
    memcpy(r.point, face->point, sizeof r.point);
    memcpy(r.normal, face->normal, sizeof r.normal);
    if (form == ANSWERS_JSON)
        at = put_text(at, first ? "[" : ", ");
    at = put_distance(at, form, &r, sampler, NULL);
    bool line = form == ANSWERS_TEXT || form == ANSWERS_CSV;
    answer_text_end(t, put_text(at, line ? "\n" : ""));
    if (line) /* other lists leave when they are complete, or too long for that */
        answer_text_close(t);
}

void answers_near_end(answer_text *t, answer_form form, bool none, const ebpo_sampler *sampler)
{
    static const ebpo_distance_result nothing = { .distance = INFINITY,
                                                  .point = { NAN, NAN, NAN },
                                                  .face = EBPO_NO_FACE };
    char *at = answer_text_room(t);
    if (form == ANSWERS_RAW)
        at = put_distance(at, form, &nothing, sampler, NULL);
    else if (form == ANSWERS_JSON)
        at = put_text(at, none ? "[]" : "]");
    end_row(t, form, at);
}

/* --- rays and boxes --- */

static char *put_hit(char *at, answer_form form, const ebpo_ray_hit *hit)
{
    if (form == ANSWERS_RAW)
        return put_u64(put_u64(put_double(at, hit->t), hit->face), (uint64_t)(int64_t)hit->side);
    bool json = form == ANSWERS_JSON;
    char lead[2] = { json ? 0 : separator_of(form), 0 };
    at = json ? put_json_real(at, "{\"t\": ", hit->t) : number_write(at, hit->t);
    at = number_write_uint(put_text(at, json ? ", \"face\": " : lead), hit->face);
    return number_write_int(put_text(at, json ? ", \"side\": " : lead), hit->side);
}

/* Writes a hit with its attributes, at the point that t gives, within the range of doubles. A t
 * beyond that range (inf) gives no point, and there are none. */
static char *put_met(char *at, answer_form form, const ebpo_ray *ray, const ebpo_ray_hit *hit,
                     const ebpo_sampler *sampler, const uint64_t *model)
{
    double point[3];
    for (int k = 0; k < 3; k++)
        point[k] = fmax(-DBL_MAX, fmin(ray->origin[k] + hit->t * ray->direction[k], DBL_MAX));
    at = put_model(put_hit(at, form, hit), form, model);
    at = put_attributes(at, form, sampler, point, isfinite(hit->t) ? hit->face : EBPO_NO_FACE);
    return put_text(at, form == ANSWERS_JSON ? "}" : "");
}

void answers_ray_first(answer_text *t, answer_form form, const ebpo_ray *rays,
                       const ebpo_ray_hit *hits, uint64_t count, const ebpo_sampler *sampler,
                       const uint64_t *model)
{
    static const char *const nothing[] = { "-", "null", "", "-,-,-" };
    for (uint64_t i = 0; i < count; i++) {
        bool none = hits[i].face == EBPO_NO_FACE && form != ANSWERS_RAW;
        char *at = answer_text_room(t);
        if (!none)
            at = put_met(at, form, &rays[i], &hits[i], sampler, model ? &model[i] : NULL);
        else
            at = put_text(at, nothing[form]);
        if (none && form == ANSWERS_CSV && model)
            at = put_model(at, form, &model[i]);
        if (none && form == ANSWERS_CSV)
            at = put_attributes(at, form, sampler, rays[i].origin, EBPO_NO_FACE);
        end_row(t, form, at);
    }
}

void answers_ray_any(answer_text *t, answer_form form, const bool *any, uint64_t count)
{
    static const char *const words[2][2] = { { "no", "yes" }, { "false", "true" } };
    for (uint64_t i = 0; i < count; i++) {
        char *at = answer_text_room(t);
        end_row(t, form,
                form == ANSWERS_RAW ? put_u64(at, any[i])
                                    : put_text(at, words[form == ANSWERS_JSON][any[i]]));
    }
}

/* Of an answer that is a list: what is before it, and after it. */
static void begin_list(answer_text *t, answer_form form, uint64_t count)
{
    char *at = answer_text_room(t);
    answer_text_end(t, form == ANSWERS_RAW    ? put_u64(at, count)
                       : form == ANSWERS_JSON ? put_text(at, "[")
                                              : number_write_uint(at, count));
}

static void end_list(answer_text *t, answer_form form)
{
    end_row(t, form, put_text(answer_text_room(t), form == ANSWERS_JSON ? "]" : ""));
}

/* Room for the next item of a list, with what is before it. */
static char *next_item(answer_text *t, answer_form form, bool first)
{
    char *at = answer_text_room(t);
    if (form == ANSWERS_JSON)
        return put_text(at, first ? "" : ", ");
    if (form != ANSWERS_RAW)
        *at++ = separator_of(form);
    return at;
}

void answers_ray_all(answer_text *t, answer_form form, const ebpo_ray *ray,
                     const ebpo_ray_hit *hits, uint64_t count, const ebpo_sampler *sampler)
{
    begin_list(t, form, count);
    for (uint64_t i = 0; i < count; i++)
        answer_text_end(t, put_met(next_item(t, form, i == 0), form, ray, &hits[i], sampler, NULL));
    end_list(t, form);
}

void answers_box(answer_text *t, answer_form form, const uint64_t *faces, uint64_t count)
{
    begin_list(t, form, count);
    for (uint64_t i = 0; i < count; i++) {
        char *at = next_item(t, form, i == 0);
        answer_text_end(t, form == ANSWERS_RAW ? put_u64(at, faces[i])
                                               : number_write_uint(at, faces[i]));
    }
    end_list(t, form);
}

/* --- names of columns --- */

static char *put_names(char *at, answer_form form, const char *names)
{
    for (; *names; names++)
        *at++ = *names == ',' ? separator_of(form) : *names;
    return at;
}

void answers_header(answer_text *t, answer_form form, const char *names, const char *attributes)
{
    char *at = put_names(answer_text_room(t), form, names);
    if (attributes) {
        *at++ = separator_of(form);
        at = put_names(at, form, attributes);
    }
    end_row(t, form, at);
}
