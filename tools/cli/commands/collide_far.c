#include "cli/commands/collide_far.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/words.h"

/* --- how models lie to each other --- */

const char *const collide_relations[] = { "DISJOINT",   "TOUCHING", "INTERSECTING", "A_INSIDE_B",
                                          "B_INSIDE_A", "EQUAL",    "not known" };

ebpo_status collide_unmet(ebpo_collider *c, const ebpo_collide_options *how, const char **relation,
                          ebpo_error *error)
{
    ebpo_relation_result r;
    *relation = NULL;
    ebpo_status status = ebpo_collide_relation(c, how, &r, error);
    if (status == EBPO_OK && r.relation != EBPO_DISJOINT && r.contact != 1)
        *relation = collide_relations[r.relation];
    if (status != EBPO_E_ABSENT && status != EBPO_E_LIMIT)
        return status;
    *error = (ebpo_error)EBPO_ERROR_INIT; /* a subset lacks what would tell */
    *relation = collide_relations[EBPO_RELATION_OPEN];
    return EBPO_OK;
}

void collide_print_unmet(bool as_json, const char *relation)
{
    bool open = relation == collide_relations[EBPO_RELATION_OPEN];
    if (relation && as_json)
        printf(open ? ", \"relation\": null" : ", \"relation\": \"%s\"", relation);
    else if (relation)
        printf(" %s", relation);
}

/* --- options --- */

/* Three numbers with blanks or commas between. */
static bool read_direction(const char *text, double out[3])
{
    for (int k = 0; k < 3; k++) {
        char *end;
        text += strspn(text, k ? " ,\t" : " \t");
        out[k] = strtod(text, &end);
        if (end == text)
            return false;
        text = end;
    }
    return text[strspn(text, " \t")] == '\0';
}

bool collide_far_asked(const collide_far *f) { return f->distance || f->depth || f->way_out; }

bool collide_far_fits(collide_far *f, bool others)
{
    const char *wrong = NULL;
    if ((collide_far_asked(f) && others) || f->distance + f->depth + (f->way_out != NULL) > 1 ||
        (!f->distance && !f->depth && f->tolerance > 0))
        wrong = "--distance, --depth and --way-out take neither --all nor --self nor each other, "
                "and only the first two take --tolerance";
    else if (f->way_out && !read_direction(f->way_out, f->direction))
        wrong = "--way-out expects a direction, three numbers 'X Y Z'";
    else if (f->at_least >= 0 && (!f->distance || f->tolerance > 0))
        wrong = "--at-least is for --distance, without --tolerance";
    else if (f->depth && !(f->tolerance > 0))
        wrong = "--depth needs a --tolerance greater than 0";
    if (wrong)
        (void)command_usage("collide", "%s", wrong);
    return !wrong;
}

/* What is certain. */
static void print_bounds(bool as_json, const ebpo_certain *d)
{
    char lo[32], hi[32];
    if (as_json)
        printf("\"lo\": %s, \"hi\": %s", json_number(d->lo, lo), json_number(d->hi, hi));
    else
        printf("%s %s", words_real(d->lo, lo), words_real(d->hi, hi));
}

/* --- distance --- */

static void pair_to_json(const ebpo_clearance *c)
{
    printf(", \"face_a\": %" PRIu64 ", \"face_b\": %" PRIu64 ", \"point_a\": [", c->pair.face_a,
           c->pair.face_b);
    words_print_reals(c->point_a, 3, ", ");
    printf("], \"point_b\": [");
    words_print_reals(c->point_b, 3, ", ");
    putchar(']');
}

/* The faces, if some have been found. */
static void print_pair(bool as_json, const ebpo_clearance *c)
{
    if (c->pair.face_a == EBPO_NO_FACE)
        return;
    if (as_json)
        pair_to_json(c);
    else
        printf(" %" PRIu64 " %" PRIu64, c->pair.face_a, c->pair.face_b);
}

/* The end of the line, with how models lie to each other that are not apart as sets of points. */
static void print_end(bool as_json, const char *relation)
{
    collide_print_unmet(as_json, relation);
    puts(as_json ? "}" : "");
}

static void print_distance(bool as_json, const ebpo_clearance *c, const char *relation)
{
    printf("%s", as_json ? "{" : "");
    print_bounds(as_json, &c->distance);
    print_pair(as_json, c);
    print_end(as_json, relation);
}

static void print_at_least(bool as_json, const ebpo_clearance *c, const char *relation)
{
    static const char *const words[2][3] = { { "not known", "no", "yes" },
                                             { "null", "false", "true" } };
    printf("%s%s", as_json ? "{\"at_least\": " : "", words[as_json][c->at_least + 1]);
    print_pair(as_json, c);
    print_end(as_json, relation);
}

static ebpo_status ask_distance(const collide_far *f, bool as_json, ebpo_collider *c,
                                const ebpo_collide_options *how, ebpo_error *error)
{
    ebpo_clearance_options wanted = EBPO_CLEARANCE_OPTIONS_INIT;
    ebpo_clearance got;
    wanted.tolerance = f->tolerance;
    wanted.at_least = f->at_least;
    ebpo_status status = ebpo_collide_distance(c, how, &wanted, &got, error);
    if (status != EBPO_OK)
        return status;
    /* where faces meet, or nothing is known of them, the line says so already */
    bool apart = got.distance.lo > 0 || (got.at_least >= 0 && got.distance.hi > 0);
    const char *relation = NULL;
    if (apart)
        status = collide_unmet(c, how, &relation, error);
    if (status != EBPO_OK)
        return status;
    if (f->at_least >= 0)
        print_at_least(as_json, &got, relation);
    else
        print_distance(as_json, &got, relation);
    return EBPO_OK;
}

/* --- depth --- */

static void print_depth(bool as_json, const char *name, bool solid, const ebpo_certain *d)
{
    printf(as_json ? "\"%s\": " : "%s ", name);
    if (!solid) {
        printf(as_json ? "null" : "- -");
        return;
    }
    printf("%s", as_json ? "{" : "");
    print_bounds(as_json, d);
    printf("%s", as_json ? "}" : "");
}

static ebpo_status ask_depth(const collide_far *f, bool as_json, ebpo_collider *c,
                             const ebpo_collide_options *how, ebpo_error *error)
{
    ebpo_certain depth[2] = { { 0, 0, 0, 0 }, { 0, 0, 0, 0 } };
    ebpo_status status[2];
    for (int i = 0; i < 2; i++) {
        status[i] = ebpo_collide_depth(c, how, f->tolerance, i == 0 ? &depth[0] : NULL,
                                       i == 1 ? &depth[1] : NULL, error);
        if (status[i] != EBPO_OK && status[i] != EBPO_E_NOT_SOLID)
            return status[i];
    }
    if (status[0] != EBPO_OK && status[1] != EBPO_OK)
        return status[0];
    printf("%s", as_json ? "{" : "");
    print_depth(as_json, "a_in_b", status[0] == EBPO_OK, &depth[0]);
    printf("%s", as_json ? ", " : "\n");
    print_depth(as_json, "b_in_a", status[1] == EBPO_OK, &depth[1]);
    puts(as_json ? "}" : "");
    return EBPO_OK;
}

/* --- the way out --- */

static ebpo_status ask_way_out(const collide_far *f, bool as_json, ebpo_collider *c,
                               const ebpo_collide_options *how, ebpo_error *error)
{
    static const char *const figures[] = { "exact", "interval", "bound" };
    ebpo_way_out w;
    ebpo_status status = ebpo_collide_way_out(c, how, f->direction, &w, error);
    if (status != EBPO_OK)
        return status;
    bool any = w.pair.face_a != EBPO_NO_FACE;
    printf("%s", as_json ? "{" : "");
    print_bounds(as_json, &w.t);
    if (as_json)
        printf(", \"figure\": \"%s\"", figures[w.t.figure]);
    if (any)
        printf(as_json ? ", \"face_a\": %" PRIu64 ", \"face_b\": %" PRIu64
                       : " %" PRIu64 " %" PRIu64,
               w.pair.face_a, w.pair.face_b);
    puts(as_json ? "}" : "");
    return EBPO_OK;
}

ebpo_status collide_far_ask(const collide_far *f, bool as_json, ebpo_collider *c,
                            const ebpo_collide_options *how, ebpo_error *error)
{
    return f->way_out    ? ask_way_out(f, as_json, c, how, error)
           : f->distance ? ask_distance(f, as_json, c, how, error)
                         : ask_depth(f, as_json, c, how, error);
}
