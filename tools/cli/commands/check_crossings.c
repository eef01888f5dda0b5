/* Prints the pairs of intersecting faces that `ebpo check --crossings` finds. */
#include "cli/commands/check_crossings.h"

#include <stdio.h>

#include "cli/words.h"

enum { PAIRS_SHOWN = 10 };

typedef struct crossing_list {
    json *j;             /* pairs are printed here when they are found; NULL: not printed yet */
    progress_line *line; /* wiped before printing */
    ebpo_self_intersection first[PAIRS_SHOWN]; /* if `j` is NULL: the first pairs */
    int count;                                 /* number of pairs in `first` */
} crossing_list;

/* Words for an ebpo_pair_kind. */
static const char *const kinds[] = { "APART", "TOUCHING", "CROSSING", "COPLANAR" };
static const char *const verbs[] = { "", "touch", "cross", "overlap" };

static void crossing_json(json *j, const ebpo_self_intersection *c)
{
    json_object(j, NULL);
    json_text(j, "kind", kinds[c->kind]);
    json_array(j, "faces");
    json_uint(j, NULL, c->face[0]);
    json_uint(j, NULL, c->face[1]);
    json_end(j);
    json_reals(j, "point", c->point, 3);
    json_end(j);
}

static bool take_crossing(void *user, const ebpo_self_intersection *crossings, uint64_t count)
{
    crossing_list *p = user;
    progress_wipe(p->line);
    for (uint64_t i = 0; i < count; i++)
        if (p->j)
            crossing_json(p->j, &crossings[i]);
        else if (p->count < PAIRS_SHOWN)
            p->first[p->count++] = crossings[i];
    return true;
}

static uint64_t pairs_of(const ebpo_self_intersections_summary *s)
{
    return s->pairs[EBPO_PAIR_CROSSING] + s->pairs[EBPO_PAIR_TOUCHING] +
           s->pairs[EBPO_PAIR_COPLANAR];
}

static void print_words(const crossing_list *p, const ebpo_self_intersections_summary *s)
{
    char pairs[64], faces[64];
    uint64_t all = pairs_of(s);
    if (all == 0) {
        puts("  no faces that cross, touch or overlap, other than neighbours");
        return;
    }
    printf("  %s that intersect, other than neighbours (%llu crossing, %llu touching, %llu "
           "overlapping), of %s:\n",
           words_plural(pairs, sizeof pairs, all, "pair of faces", "pairs of faces"),
           (unsigned long long)s->pairs[EBPO_PAIR_CROSSING],
           (unsigned long long)s->pairs[EBPO_PAIR_TOUCHING],
           (unsigned long long)s->pairs[EBPO_PAIR_COPLANAR],
           words_plural(faces, sizeof faces, s->faces, "face", "faces"));
    for (int i = 0; i < p->count; i++) {
        const ebpo_self_intersection *c = &p->first[i];
        printf("    faces %llu and %llu %s near %.9g %.9g %.9g\n", (unsigned long long)c->face[0],
               (unsigned long long)c->face[1], verbs[c->kind], c->point[0], c->point[1],
               c->point[2]);
    }
    if (all > (uint64_t)p->count)
        printf("    ... (--json prints all)\n");
}

/* Ends the list of pairs and the object "crossings"; the outermost object stays open. found: false
 * after a failure; then "count" is null. */
static void end_json(json *j, const ebpo_self_intersections_summary *s, bool found)
{
    json_end(j);
    if (found) {
        json_uint(j, "count", pairs_of(s));
        json_uint(j, "crossing", s->pairs[EBPO_PAIR_CROSSING]);
        json_uint(j, "touching", s->pairs[EBPO_PAIR_TOUCHING]);
        json_uint(j, "coplanar", s->pairs[EBPO_PAIR_COPLANAR]);
        json_uint(j, "faces", s->faces);
    } else
        json_null(j, "count");
    json_end(j);
}

ebpo_status check_crossings(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                            const ebpo_self_intersections_options *options, json *j, bool quiet,
                            progress_line *line, ebpo_error *error)
{
    crossing_list p = { .j = j, .line = line };
    ebpo_self_intersections_summary sum = EBPO_SELF_INTERSECTIONS_SUMMARY_INIT;
    if (j) {
        json_object(j, "crossings");
        json_array(j, "pairs");
    }
    ebpo_status status =
        ebpo_mesh_self_intersections(mesh, report, options, take_crossing, &p, &sum, error);
    progress_wipe(line);
    if (j)
        end_json(j, &sum, status == EBPO_OK);
    else if (status == EBPO_OK && !quiet)
        print_words(&p, &sum);
    return status;
}
