/* Prints doubts (reasons why a mesh may not bound the intended solid), and the repairs that were
 * tried on copies of the mesh. */
#include "cli/mesh_advice.h"

#include <string.h>

#include "cli/mesh_findings.h"
#include "cli/words.h"

static const struct doubt_text {
    ebpo_doubt doubt;
    const char *key, *words;
} doubts[] = {
    { EBPO_DOUBT_OPEN, "open", "its edges do not balance" },
    { EBPO_DOUBT_UNWELDED, "unwelded",
      "holes were filled between vertices at one position, which --weld merges first" },
    { EBPO_DOUBT_MOSTLY_OPEN, "mostly_open",
      "more than half of all edges were edges of holes that were filled" },
    { EBPO_DOUBT_MOSTLY_FILLED, "mostly_filled", "filling holes added as much area as was given" },
    { EBPO_DOUBT_NO_VOLUME, "no_volume", "it has hardly any volume" },
    { EBPO_DOUBT_INSIDE_OUT, "inside_out",
      "it is turned inside out: normals point inwards, so a point within has winding number -1, "
      "which is inside by the rules nonzero and evenodd but outside by positive; --orient turns "
      "it" },
};
enum { DOUBTS = sizeof doubts / sizeof *doubts };

const char *advice_doubts(char *out, size_t size, const mesh_input *p)
{
    size_t used = 0;
    out[0] = 0;
    for (int i = 0; i < DOUBTS && used < size; i++)
        if (p->doubts & doubts[i].doubt)
            used += (size_t)snprintf(out + used, size - used, "%s%s", used ? "; " : "",
                                     doubts[i].words);
    return out;
}

/* Writes the options of the repairs in a record, such as "--weld --orient". */
static const char *steps_text(char *out, size_t size, const ebpo_repair_record *r)
{
    snprintf(out, size, "%s%s%s%s", r->weld ? " --weld" : "",
             r->drop_duplicates ? " --drop-duplicates" : "", r->orient ? " --orient" : "",
             r->fill_holes ? " --fill-holes" : "");
    return out + 1;
}

/* ---- warnings ---- */

/* Prints the number of findings of one kind, if there are any. *any: true if another kind was
 * printed before; becomes true if this kind is printed. */
static void print_count(FILE *out, bool *any, const ebpo_finding *f, const char *one,
                        const char *many)
{
    char text[80];
    if (f->count)
        fprintf(out, "%s %s", *any ? "," : ":",
                words_plural(text, sizeof text, f->count, one, many));
    *any |= f->count > 0;
}

static void warn_of_surface(FILE *out, const ebpo_mesh_report *r)
{
    bool any = false;
    fputs("warning: this is a surface, not a solid; solid angles decide what is inside", out);
    print_count(out, &any, &r->boundary_edges, "boundary edge", "boundary edges");
    print_count(out, &any, &r->misoriented_edges, "misoriented edge", "misoriented edges");
    print_count(out, &any, &r->nonmanifold_edges, "edge shared by more than two faces",
                "edges shared by more than two faces");
    if (!any)
        print_count(out, &any, &r->unbalanced_edges, "unbalanced edge", "unbalanced edges");
}

static const char *volume_text(char text[FINDINGS_VOLUME], const ebpo_repair_try *t, ebpo_rule rule)
{
    ebpo_solid_volume solid = findings_solid(&t->report, rule, NULL, NULL);
    return findings_volume(text, &solid, &t->report, "");
}

/* Writes text for the result of a repair: "a solid of volume V". If the volume is not known, writes
 * "a solid with integral of the winding number V". */
static const char *solid_text(char text[FINDINGS_VOLUME], const ebpo_repair_try *t, ebpo_rule rule)
{
    char volume[FINDINGS_VOLUME];
    volume_text(volume, t, rule);
    snprintf(text, FINDINGS_VOLUME, "a solid %s %.200s", volume[0] == 'v' ? "of" : "with", volume);
    return text;
}

/* Prints the best repair that was tried, or how to try repairs. */
static void print_remedy(FILE *out, const mesh_input *p)
{
    char steps[64], solid[FINDINGS_VOLUME];
    if (p->repairs_tried && p->repairs.chosen >= 0) {
        const ebpo_repair_try *best = &p->repairs.tries[p->repairs.chosen];
        fprintf(out, "; %s, which --repair does, leaves %s",
                steps_text(steps, sizeof steps, &best->record), solid_text(solid, best, p->rule));
    } else if (p->repairs_tried)
        fputs("; no automatic repair gives a solid; try --weld-distance if corners nearly "
              "coincide, or a mesh editor",
              out);
    else
        fputs("; 'ebpo check' without options reports which repairs give a solid, --repair applies "
              "them",
              out);
}

/* Names the option that orients components, in a form that the command accepts. */
static const char *orient_text(const mesh_input *p)
{
    return p->chosen_by_repair ? "--orient instead of --repair" : "--orient";
}

static void warn_of_inside_out(FILE *out, const char *command, const char *path,
                               const mesh_input *p)
{
    const ebpo_shells *s = &p->shells;
    fprintf(out,
            "ebpo %s: %s: warning: %llu of %llu closed components %s turned inside out: normals "
            "point inwards, so winding numbers inside are smaller by 1 instead of greater, and the "
            "rule positive treats the inside as outside; %s corrects this\n",
            command, path, (unsigned long long)s->inside_out, (unsigned long long)s->closed,
            s->inside_out == 1 ? "is" : "are", orient_text(p));
}

static void warn_of_nested(FILE *out, const char *command, const char *path, const mesh_input *p)
{
    const ebpo_shells *s = &p->shells;
    fprintf(out,
            "ebpo %s: %s: warning: %llu of %llu closed components %s within another and oriented "
            "outwards "
            "like it: winding numbers inside are greater by 1, so there is no cavity by the rules "
            "nonzero and positive, but by evenodd there is; %s makes cavities\n",
            command, path, (unsigned long long)s->nested, (unsigned long long)s->closed,
            s->nested == 1 ? "is" : "are", orient_text(p));
}

/* Warns of faces that have the positions and the orientation of an earlier face, but not its
 * vertices. */
static void warn_of_repeated_positions(FILE *out, const char *command, const char *path,
                                       const mesh_input *p)
{
    char text[80];
    fprintf(out,
            "ebpo %s: %s: warning: %s at the positions of an earlier one with the same orientation "
            "(face %llu%s), which counts twice in winding numbers; --weld with --drop-duplicates "
            "drops such faces\n",
            command, path,
            words_plural(text, sizeof text, p->repeated_same, "face is", "faces are"),
            (unsigned long long)p->repeated.locations[0], p->repeated.count > 1 ? ", ..." : "");
}

/* Returns the repairs that --repair chose and made, or NULL. */
static const ebpo_repair_record *find_made(const mesh_input *p)
{
    return p->chosen_by_repair && p->repairs_tried && p->repairs.chosen >= 0
               ? &p->repairs.tries[p->repairs.chosen].record
               : NULL;
}

/* Returns the result of dropping repeated faces alone, if this was tried. */
static const ebpo_repair_try *find_drop_only(const mesh_input *p)
{
    for (uint64_t i = 0; p->repairs_tried && i < p->repairs.count; i++) {
        const ebpo_repair_record *r = &p->repairs.tries[i].record;
        if (r->drop_duplicates && !r->orient && !r->fill_holes)
            return &p->repairs.tries[i];
    }
    return NULL;
}

static void warn_of_repeated(FILE *out, const char *command, const char *path, const mesh_input *p)
{
    const ebpo_finding *f = &p->prepared.report.repeated_faces;
    const ebpo_repair_record *made = find_made(p);
    const ebpo_repair_try *t = find_drop_only(p);
    char text[80], steps[64], solid[FINDINGS_VOLUME];
    fprintf(out, "ebpo %s: %s: warning: %s of the same three vertices as an earlier one (face %llu",
            command, path, words_plural(text, sizeof text, f->count, "face is", "faces are"),
            (unsigned long long)f->locations[0]);
    fputs(f->count > 1 ? ", ...): " : "): ", out);
    if (made) { /* repairs were tried on the mesh before it was repaired */
        fprintf(out, "%s --drop-duplicates instead of --repair drops such faces, too\n",
                steps_text(steps, sizeof steps, made));
        return;
    }
    if (!t) {
        fprintf(out, "--drop-duplicates drops such faces%s\n",
                p->repairs_tried ? "" : "; 'ebpo check' without options reports the result");
        return;
    }
    if (t->record.dropped_opposite)
        fprintf(out, "%llu with the opposite orientation, as the sides of a sheet have; ",
                (unsigned long long)t->record.dropped_opposite);
    if (t->record.dropped_opposite < f->count)
        fprintf(out, "%llu with the same orientation, which counts in winding numbers and volume; ",
                (unsigned long long)(f->count - t->record.dropped_opposite));
    fputs(steps_text(steps, sizeof steps, &t->record), out);
    if (t->report.balanced)
        fprintf(out, " leaves %s\n", solid_text(solid, t, p->rule));
    else
        fprintf(out, " alone leaves a surface, %llu edges of which do not balance\n",
                (unsigned long long)t->report.unbalanced_edges.count);
}

static void warn_of_dropped(FILE *out, const char *command, const char *path,
                            const ebpo_repair_record *r)
{
    fprintf(
        out,
        "ebpo %s: %s: WARNING: it was a solid before repeated faces were dropped, %llu of which "
        "had the opposite orientation of the kept face; omit --drop-duplicates\n",
        command, path, (unsigned long long)r->dropped_opposite);
}

void advice_warn(FILE *out, const char *command, const char *path, const mesh_input *p)
{
    char text[1024];
    if (p->shells_counted && p->shells.inside_out && !(p->doubts & EBPO_DOUBT_INSIDE_OUT))
        warn_of_inside_out(out, command, path, p);
    if (p->shells_counted && p->shells.nested && !(p->doubts & EBPO_DOUBT_INSIDE_OUT))
        warn_of_nested(out, command, path, p);
    if (p->prepared.report.repeated_faces.count)
        warn_of_repeated(out, command, path, p);
    if (p->repeated_same && p->repeated.count > p->prepared.report.repeated_faces.count)
        warn_of_repeated_positions(out, command, path, p);
    if (p->prepared.record.dropped_faces && p->prepared.before.balanced &&
        p->doubts & EBPO_DOUBT_OPEN)
        warn_of_dropped(out, command, path, &p->prepared.record);
    if (!p->doubts)
        return;
    fprintf(out, "ebpo %s: %s: ", command, path);
    if (p->doubts & EBPO_DOUBT_OPEN)
        warn_of_surface(out, &p->prepared.report);
    else
        fprintf(out, "WARNING: probably not the intended solid: %s",
                advice_doubts(text, sizeof text, p));
    if (p->doubts != EBPO_DOUBT_INSIDE_OUT || p->repairs_tried)
        print_remedy(out, p);
    fputc('\n', out);
}

/* ---- repairs tried ---- */

static void print_try(FILE *out, const ebpo_repair_try *t, ebpo_rule rule)
{
    char steps[64], text[80], volume[FINDINGS_VOLUME];
    const ebpo_mesh_report *r = &t->report;
    fprintf(out, "    %s: %s, ", steps_text(steps, sizeof steps, &t->record),
            words_plural(text, sizeof text, r->components, "component", "components"));
    if (r->balanced)
        fputs(volume_text(volume, t, rule), out);
    else
        fprintf(out, "%llu edges do not balance", (unsigned long long)r->unbalanced_edges.count);
    if (t->record.filled_holes) {
        fprintf(out, ", %s filled",
                words_plural(text, sizeof text, t->record.filled_holes, "hole", "holes"));
        fprintf(out, " with %s",
                words_plural(text, sizeof text, t->record.added_faces, "face", "faces"));
    }
    fputs(t->doubts == 0                        ? ": a plausible solid\n"
          : (t->doubts & EBPO_DOUBT_OPEN)       ? ": still a surface\n"
          : (t->doubts & EBPO_DOUBT_INSIDE_OUT) ? ": turned inside out\n"
          : (t->doubts & EBPO_DOUBT_NO_VOLUME)  ? ": hardly any volume\n"
                                                : ": more filled than is plausible\n",
          out);
}

void advice_print_shells(FILE *out, const mesh_input *p)
{
    char text[80];
    const ebpo_shells *s = &p->shells;
    if (p->repeated.count > p->prepared.report.repeated_faces.count)
        fprintf(out,
                "  %s at the positions of an earlier one, %llu with the opposite orientation\n",
                words_plural(text, sizeof text, p->repeated.count, "face", "faces"),
                (unsigned long long)p->repeated_opposite);
    if (!p->shells_counted || !(s->inside_out || s->nested || s->cavities))
        return;
    fprintf(out, "  %s",
            words_plural(text, sizeof text, s->closed, "closed component", "closed components"));
    fprintf(out, ": %s",
            words_plural(text, sizeof text, s->cavities, "is a cavity", "are cavities"));
    fprintf(out, ", %s",
            words_plural(text, sizeof text, s->inside_out, "is inside out", "are inside out"));
    if (s->nested)
        fprintf(out, ", %s (%s makes cavities)",
                words_plural(text, sizeof text, s->nested,
                             "is within another and oriented outwards like it",
                             "are within others and oriented outwards like them"),
                orient_text(p));
    fputc('\n', out);
}

void advice_print(FILE *out, const mesh_input *p)
{
    if (!p->repairs_tried)
        return;
    fputs("  repairs tried, with their results:\n", out);
    for (uint64_t i = 0; i < p->repairs.count; i++)
        print_try(out, &p->repairs.tries[i], p->rule);
}

/* ---- JSON ---- */

static void json_doubts(json *j, uint32_t set)
{
    json_array(j, "doubts");
    for (int i = 0; i < DOUBTS; i++)
        if (set & doubts[i].doubt)
            json_text(j, NULL, doubts[i].key);
    json_end(j);
}

static void json_try(json *j, const ebpo_repair_try *t, ebpo_rule rule)
{
    ebpo_solid_volume solid = findings_solid(&t->report, rule, NULL, NULL);
    json_object(j, NULL);
    json_array(j, "steps");
    if (t->record.weld)
        json_text(j, NULL, "weld");
    if (t->record.drop_duplicates)
        json_text(j, NULL, "drop-duplicates");
    if (t->record.orient)
        json_text(j, NULL, "orient");
    if (t->record.fill_holes)
        json_text(j, NULL, "fill-holes");
    json_end(j);
    json_bool(j, "balanced", t->report.balanced);
    json_uint(j, "components", t->report.components);
    json_uint(j, "unbalanced_edges", t->report.unbalanced_edges.count);
    json_uint(j, "filled_holes", t->record.filled_holes);
    json_uint(j, "added_faces", t->record.added_faces);
    json_real(j, "area", t->report.area);
    findings_volume_json(j, &solid);
    json_doubts(j, t->doubts);
    json_end(j);
}

/* Writes the number of faces at the positions of an earlier face. If no vertices coincide, writes
 * null, because then repeated_faces in the report is this number. */
static void json_repeated(json *j, const mesh_input *p)
{
    if (!p->prepared.report.repeated_positions.count) {
        json_null(j, "repeated_by_position");
        return;
    }
    json_object(j, "repeated_by_position");
    json_uint(j, "faces", p->repeated.count);
    json_uint(j, "opposite", p->repeated_opposite);
    json_end(j);
}

static void json_shells(json *j, const mesh_input *p)
{
    if (!p->shells_counted) {
        json_null(j, "shells");
        return;
    }
    json_object(j, "shells");
    json_uint(j, "closed", p->shells.closed);
    json_uint(j, "inside_out", p->shells.inside_out);
    json_uint(j, "cavities", p->shells.cavities);
    json_uint(j, "nested", p->shells.nested);
    json_bool(j, "apart", p->shells.apart);
    json_end(j);
}

void advice_json(json *j, const mesh_input *p)
{
    json_doubts(j, p->doubts);
    json_repeated(j, p);
    json_shells(j, p);
    if (!p->repairs_tried) {
        json_null(j, "repairs");
        return;
    }
    json_object(j, "repairs");
    json_array(j, "tried");
    for (uint64_t i = 0; i < p->repairs.count; i++)
        json_try(j, &p->repairs.tries[i], p->rule);
    json_end(j);
    if (p->repairs.chosen >= 0)
        json_int(j, "chosen", p->repairs.chosen);
    else
        json_null(j, "chosen");
    json_end(j);
}
