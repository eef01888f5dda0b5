#include "cli/commands/check_places.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "cli/mesh_findings.h"

typedef struct telling {
    json *j; /* NULL: words, if `words` */
    bool words;
    progress_line *line;
    uint64_t count[EBPO_FINDING_KINDS];
} telling;

bool check_places_good(const char *to)
{
    size_t length = strlen(to);
    return strcmp(to, "all") == 0 || (length > 4 && strcasecmp(to + length - 4, ".ply") == 0);
}

const char *check_places_ply(const char *to) { return strcmp(to, "all") == 0 ? NULL : to; }

static void place_json(json *j, const ebpo_mesh_place *p)
{
    json_object(j, NULL);
    json_text(j, "kind", ebpo_finding_name(p->kind));
    if (p->component == EBPO_NO_COMPONENT)
        json_null(j, "component");
    else
        json_uint(j, "component", p->component);
    json_array(j, "faces");
    for (uint64_t i = 0; i < p->face_count; i++)
        json_uint(j, NULL, p->faces[i]);
    json_end(j);
    json_array(j, "vertices");
    for (int i = 0; i < (p->vertex[0] == p->vertex[1] ? 1 : 2); i++)
        json_uint(j, NULL, p->vertex[i]);
    json_end(j);
    json_reals(j, "point", p->point, 3);
    json_end(j);
}

enum { FACES_SHOWN = 8 };

static void place_words(const ebpo_mesh_place *p)
{
    printf("    at %.9g %.9g %.9g", p->point[0], p->point[1], p->point[2]);
    if (p->component != EBPO_NO_COMPONENT)
        printf(", component %lu", (unsigned long)p->component);
    if (p->vertex[0] == p->vertex[1])
        printf(", vertex %llu", (unsigned long long)p->vertex[0]);
    else
        printf(", vertices %llu %llu", (unsigned long long)p->vertex[0],
               (unsigned long long)p->vertex[1]);
    for (uint64_t i = 0; i < p->face_count && i < FACES_SHOWN; i++)
        printf("%s %llu",
               i                    ? ""
               : p->face_count == 1 ? ", face"
                                    : ", faces",
               (unsigned long long)p->faces[i]);
    puts(p->face_count > FACES_SHOWN ? " ..." : "");
}

static bool take(void *user, const ebpo_mesh_place *p)
{
    telling *t = user;
    bool first = t->count[p->kind]++ == 0;
    if (!t->j && !t->words)
        return true;
    progress_wipe(t->line);
    if (t->j) {
        place_json(t->j, p);
    } else {
        if (first)
            printf("  %s:\n", findings_many(ebpo_finding_name(p->kind)));
        place_words(p);
    }
    return true;
}

static void print_legend(const char *path, const uint64_t count[EBPO_FINDING_KINDS])
{
    printf("  places of findings, in colours: %s\n", path);
    for (int kind = 0; kind < EBPO_FINDING_KINDS; kind++) {
        uint8_t rgb[3];
        ebpo_finding_colour(kind, rgb);
        if (count[kind])
            printf("    %3u %3u %3u  %llu %s\n", rgb[0], rgb[1], rgb[2],
                   (unsigned long long)count[kind], findings_many(ebpo_finding_name(kind)));
    }
}

ebpo_status check_places(const ebpo_mesh *mesh, const char *to, unsigned threads,
                         ebpo_progress progress, json *j, bool quiet, progress_line *line,
                         ebpo_error *error)
{
    ebpo_places_options how = EBPO_PLACES_OPTIONS_INIT;
    telling t = { .j = j, .line = line };
    how.threads = threads;
    how.progress = progress;
    how.ply = check_places_ply(to);
    t.words = !quiet && !how.ply;
    if (j)
        json_array(j, "places");
    ebpo_status status = ebpo_mesh_places(mesh, &how, take, &t, NULL, error);
    progress_wipe(line);
    if (j)
        json_end(j);
    else if (status == EBPO_OK && how.ply && !quiet)
        print_legend(how.ply, t.count);
    return status;
}
