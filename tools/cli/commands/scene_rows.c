#include "cli/commands/scene_rows.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/commands/clash_list.h"
#include "cli/words.h"

const char *scene_instance_name(const ebpo_scene *scene, uint64_t instance)
{
    ebpo_scene_instance i = EBPO_SCENE_INSTANCE_INIT;
    (void)ebpo_scene_get_instance(scene, instance, &i);
    return i.name;
}

static const char *relation_word(int32_t relation)
{
    static const char *const words[] = { "disjoint",   "touching",   "intersecting",
                                         "a inside b", "b inside a", "equal" };
    return relation < EBPO_RELATION_OPEN ? words[relation] : NULL;
}

/* --- JSON --- */

static void depth_json(json *j, const char *key, const ebpo_certain *depth)
{
    json_object(j, key);
    json_real(j, "lo", depth->lo);
    json_real(j, "hi", depth->hi);
    json_end(j);
}

static void counts_json(json *j, const ebpo_scene_meeting *m)
{
    json_uint(j, "touching", m->touching);
    json_uint(j, "coplanar", m->coplanar);
    json_uint(j, "crossing", m->crossing);
    if (m->contacts < UINT64_MAX)
        json_uint(j, "contacts", m->contacts);
    else
        json_null(j, "contacts");
}

void scene_row_json(json *j, const scene_values *v, const ebpo_scene *scene,
                    const ebpo_scene_meeting *m)
{
    const char *relation = relation_word(m->relation);
    json_object(j, NULL);
    json_text(j, "a", scene_instance_name(scene, m->a));
    json_text(j, "b", scene_instance_name(scene, m->b));
    json_text(j, "kind", clash_kind_word(m->kind));
    if (relation)
        json_text(j, "relation", relation);
    json_uint(j, "face_a", m->face_a);
    json_uint(j, "face_b", m->face_b);
    if (v->count)
        counts_json(j, m);
    json_real(j, "clearance", m->clearance);
    json_real(j, "distance", m->distance);
    if (v->places) {
        json_reals(j, "place", m->place, 3);
        json_reals(j, "place_min", m->place_min, 3);
        json_reals(j, "place_max", m->place_max, 3);
    }
    if (v->depth > 0) {
        depth_json(j, "depth_of_a", &m->depth[0]);
        depth_json(j, "depth_of_b", &m->depth[1]);
    }
    json_end(j);
}

/* --- CSV --- */

void scene_head_csv(const scene_values *v)
{
    printf("time,a,b,kind,distance,face_a,face_b%s%s%s%s\n",
           v->count ? ",touching,coplanar,crossing,contacts" : "",
           v->solids || v->depth > 0 ? ",relation" : "", v->places ? ",x,y,z" : "",
           v->depth > 0 ? ",a_in_b_lo,a_in_b_hi,b_in_a_lo,b_in_a_hi" : "");
}

/* Quotes are doubled. Tables take what begins so for a formula: then there is a ' before it, and
 * before another one, so that taking the first one away gives the text. */
static void csv_text(const char *text)
{
    putchar('"');
    if (*text && strchr("=+-@'", *text))
        putchar('\'');
    for (; *text; text++) {
        if (*text == '"')
            putchar('"');
        putchar(*text);
    }
    putchar('"');
}

/* What is not known stays empty. */
static void csv_real(double x)
{
    char text[32];
    putchar(',');
    if (isfinite(x))
        fputs(words_real(x, text), stdout);
}

static void csv_count(uint64_t n)
{
    putchar(',');
    if (n < UINT64_MAX)
        printf("%llu", (unsigned long long)n);
}

void scene_row_csv(const scene_values *v, const ebpo_scene *scene, double time,
                   const ebpo_scene_meeting *m)
{
    const uint64_t counts[] = { m->touching, m->coplanar, m->crossing, m->contacts };
    char text[32];
    printf("%s,", words_real(time, text));
    csv_text(scene_instance_name(scene, m->a));
    putchar(',');
    csv_text(scene_instance_name(scene, m->b));
    printf(",%s,%s,%llu,%llu", clash_kind_word(m->kind), words_real(m->distance, text),
           (unsigned long long)m->face_a, (unsigned long long)m->face_b);
    for (int i = 0; i < 4 && v->count; i++)
        csv_count(counts[i]);
    if (v->solids || v->depth > 0)
        printf(",%s", relation_word(m->relation));
    for (int k = 0; k < 3 && v->places; k++)
        csv_real(m->place[k]);
    for (int i = 0; i < 2 && v->depth > 0; i++) {
        csv_real(m->depth[i].hi < INFINITY ? m->depth[i].lo : NAN);
        csv_real(m->depth[i].hi);
    }
    putchar('\n');
}

/* --- words --- */

static void depth_words(const char *which, const ebpo_certain *depth)
{
    if (depth->hi < INFINITY)
        printf("\t%s %.9g to %.9g deep", which, depth->lo, depth->hi);
}

void scene_row_words(const scene_values *v, const ebpo_scene *scene, double time,
                     const ebpo_scene_meeting *m)
{
    uint64_t pairs = m->touching + m->coplanar + m->crossing;
    printf("%.9g\t%s\t%s\t%s", time, clash_kind_word(m->kind), scene_instance_name(scene, m->a),
           scene_instance_name(scene, m->b));
    if (m->kind == EBPO_MEETING_ENCLOSED)
        printf("\t%s is inside",
               scene_instance_name(scene, m->relation == EBPO_A_INSIDE_B ? m->a : m->b));
    if (m->kind == EBPO_MEETING_NEAR)
        printf("\t%.9g of %.9g", m->distance, m->clearance);
    else if (v->count && pairs)
        printf("\t%llu pairs of faces", (unsigned long long)pairs);
    if (v->depth > 0) {
        depth_words("a", &m->depth[0]);
        depth_words("b", &m->depth[1]);
    }
    if (v->places && isfinite(m->place[0]))
        printf("\tat %.9g %.9g %.9g", m->place[0], m->place[1], m->place[2]);
    putchar('\n');
}
