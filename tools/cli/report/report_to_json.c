/* Writes report.json: the values of report.csv, with descriptions, the model and the machine. */
#include "cli/json.h"
#include "cli/mesh_findings.h"
#include "cli/report/report_data.h"
#include "cli/words.h"

static void print_names(json *j, const char *scope, const metric_name *names, int count)
{
    for (int i = 0; i < count; i++) {
        json_object(j, NULL);
        json_text(j, "name", names[i].name);
        json_text(j, "of", scope);
        json_text(j, "unit", names[i].unit);
        json_bool(j, "timed", names[i].timed);
        json_text(j, "meaning", names[i].meaning);
        if (names[i].absent)
            json_text(j, "absent", names[i].absent);
        json_end(j);
    }
}

static void print_metrics(json *j, const metric_name *names, const double *v, int count)
{
    for (int i = 0; i < count; i++)
        json_real(j, names[i].name, v[i]);
}

/* Prints the levels of --unlimited. The envelope volume of a level includes the leaves and black
 * nodes of the levels above, because they also represent the solid at this level. */
static void print_unlimited(json *j, const method *m)
{
    double above = 0;
    json_object(j, "unlimited");
    json_real(j, "seconds", m->unlimited_seconds);
    json_array(j, "levels");
    for (int i = 0; i < m->unlimited->level_count; i++) {
        const ebpo_thesis_level *l = &m->unlimited->level[i];
        above += l->leaf_volume + l->black_volume;
        json_object(j, NULL);
        json_int(j, "level", i);
        json_uint(j, "gray", l->gray_count);
        json_uint(j, "leaf", l->leaf_count);
        json_uint(j, "leaf_faces", l->leaf_faces);
        json_uint(j, "planes", l->plane_count);
        json_uint(j, "leaf_planes", l->leaf_plane_count);
        json_real(j, "envelope_volume", above + l->gray_volume);
        json_end(j);
    }
    json_end(j);
    json_end(j);
}

static void print_method(json *j, const comparison *c, const method *m)
{
    json_object(j, NULL);
    json_text(j, "name", m->name);
    json_text(j, "file", remote_shown(m->path));
    const ebpo_selection_traits *selection =
        ebpo_selection_describe((ebpo_selection)m->info.selection);
    json_text(j, "selection", selection ? selection->name : "other");
    if (m->info.percent > 0)
        json_real(j, "percent", m->info.percent);
    if (m->info.k_root > 0)
        json_real(j, "k_root", m->info.k_root);
    json_int(j, "levels_in_file", m->levels);
    json_bool(j, "leaf_planes_stored", m->info.parts & EBPO_PART_LEAF_PLANES);
    print_metrics(j, whole_metrics, m->whole, WHOLE_METRICS);
    json_array(j, "levels");
    for (int i = c->first; i <= method_last(c, m); i++) {
        json_object(j, NULL);
        json_int(j, "level", i);
        print_metrics(j, level_metrics, m->level[i], LEVEL_METRICS);
        json_end(j);
    }
    json_end(j);
    if (m->unlimited)
        print_unlimited(j, m);
    json_array(j, "deadlines");
    for (int i = 0; i < DEADLINES; i++) {
        json_object(j, NULL);
        json_uint(j, "microseconds", deadlines_us[i]);
        print_metrics(j, deadline_metrics, m->deadline[i], DEADLINE_METRICS);
        json_end(j);
    }
    json_end(j);
    json_array(j, "budgets");
    for (int i = 0; i < BUDGETS; i++) {
        json_object(j, NULL);
        json_uint(j, "part", budget_parts[i]);
        print_metrics(j, budget_metrics, m->budget[i], BUDGET_METRICS);
        json_end(j);
    }
    json_end(j);
    json_array(j, "targets");
    for (int i = 0; i < m->target_count; i++) {
        json_object(j, NULL);
        json_real(j, m->targets[i].kind == TARGET_ERROR ? "max_error" : "target_bytes",
                  m->targets[i].requested);
        print_metrics(j, target_metrics, m->targets[i].metric, TARGET_METRICS);
        json_end(j);
    }
    json_end(j);
    json_array(j, "notes");
    for (int i = 0; i < m->note_count; i++)
        json_text(j, NULL, m->note[i]);
    json_end(j);
    json_end(j);
}

static void print_model(json *j, const comparison *c)
{
    const ebpo_info *info = &c->methods->info;
    char hex[65];
    words_hex(info->source_sha256, hex);
    json_object(j, "model");
    json_text(j, "name", c->model);
    json_text(j, "source", info->source_name);
    json_text(j, "source_sha256", hex);
    json_uint(j, "source_bytes", info->source_size);
    json_text(j, "kind", info->solid ? "solid" : "surface");
    json_text(j, "rule", words_rule(info->rule));
    json_text(j, "coordinates", info->double_coordinates ? "double" : "float");
    json_uint(j, "faces", info->face_count);
    json_uint(j, "vertices", info->vertex_count);
    json_text(j, "unit", info->unit);
    findings_volume_json(j, &c->methods->solid);
    json_real(j, "area", info->report.area);
    json_reals(j, "min", info->report.min, 3);
    json_reals(j, "max", info->report.max, 3);
    json_real(j, "diagonal", c->diagonal);
    json_end(j);
}

void report_to_json(FILE *out, const comparison *c, bool in_page)
{
    json j;
    json_begin(&j, out);
    j.in_page = in_page;
    json_object(&j, NULL);
    json_text(&j, "version", ebpo_version());
    json_int(&j, "seed", c->v->seed);
    json_uint(&j, "points", c->points);
    json_real(&j, "seconds", c->seconds);
    json_object(&j, "machine");
    json_text(&j, "processor", machine_processor());
    json_uint(&j, "cores", machine_cores());
    json_end(&j);
    print_model(&j, c);
    json_object(&j, "levels");
    json_int(&j, "first", c->first);
    json_int(&j, "last", comparison_last(c));
    json_end(&j);
    if (c->without_pictures)
        json_text(&j, "without_pictures", c->without_pictures);
    json_array(&j, "quantities");
    print_names(&j, "method", whole_metrics, WHOLE_METRICS);
    print_names(&j, "level", level_metrics, LEVEL_METRICS);
    print_names(&j, "deadline", deadline_metrics, DEADLINE_METRICS);
    print_names(&j, "budget", budget_metrics, BUDGET_METRICS);
    print_names(&j, "target", target_metrics, TARGET_METRICS);
    json_end(&j);
    json_array(&j, "methods");
    for (int i = 0; i < c->count; i++)
        print_method(&j, c, &c->methods[i]);
    json_end(&j);
    json_finish(&j);
}
