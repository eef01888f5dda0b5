#include "cli/file_facts.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include <ebpo/build.h>

#include "cli/mesh_findings.h"
#include "cli/tables.h"
#include "cli/words.h"

/* Returns true if the volume is negative but too small for a double. Such a volume is stored as -0.
 */
static bool has_negative_volume(const ebpo_mesh_report *r)
{
    double box = (r->max[0] - r->min[0]) * (r->max[1] - r->min[1]) * (r->max[2] - r->min[2]);
    return r->volume == 0 && signbit(r->volume) && box < DBL_MIN;
}

const char *facts_inside_out(const ebpo_info *info)
{
    if (!info->solid || !(info->report.volume < 0 || has_negative_volume(&info->report)))
        return NULL;
    return info->rule == EBPO_RULE_POSITIVE
               ? "turned inside out: normals point inwards, and points within have winding number "
                 "-1, which by this file's rule is outside; convert again with --orient"
               : "turned inside out: normals point inwards, and points within have winding number "
                 "-1, which is inside by this file's rule but not by the rule positive; convert "
                 "again with --orient";
}

uint64_t facts_cumulative(const ebpo_info *info, const ebpo_stored_sizes *stored, int level)
{
    uint64_t sum = info->head_bytes;
    for (int i = 0; i <= level; i++)
        sum += stored->level_bytes[i];
    return sum + (level >= info->index_level ? info->chunk_index_bytes : 0);
}

/* --- words --- */

static void print_source(FILE *out, const ebpo_info *info)
{
    char bytes[32], hex[65];
    words_hex(info->source_sha256, hex);
    fprintf(out, "  source    %s", info->source_name[0] ? info->source_name : "(no file)");
    if (info->source_format[0])
        fprintf(out, ", %s, %s\n            SHA-256 %s", info->source_format,
                words_bytes(bytes, sizeof bytes, info->source_size), hex);
    fprintf(out, "\n            %llu vertices, %llu triangles\n",
            (unsigned long long)info->source_vertex_count,
            (unsigned long long)info->source_face_count);
}

static void print_border(FILE *out, const ebpo_info *info)
{
    char edges[40], loops[40], longest[40], share[48] = "";
    double percent = 100 * info->border_area / info->report.area;
    if (isfinite(percent)) /* areas may be beyond the doubles */
        snprintf(share, sizeof share, ", %.3g %% of the mesh's area", percent);
    fprintf(out, "\n  border    %s in %s (longest loop: %s); caps have area %.4g%s%s",
            words_plural(edges, sizeof edges, info->border_points, "edge", "edges"),
            words_plural(loops, sizeof loops, info->border_loops, "loop", "loops"),
            words_plural(longest, sizeof longest, info->border_longest, "edge", "edges"),
            info->border_area, share, info->border_inside ? "; envelopes contain the inside" : "");
}

static void print_surface(FILE *out, const ebpo_info *info)
{
    char triangles[40], patches[40];
    fprintf(out, "\n  surface   simplified: %s in %s",
            words_plural(triangles, sizeof triangles, info->surface_triangles, "triangle",
                         "triangles"),
            words_plural(patches, sizeof patches, info->surface_patches, "patch", "patches"));
}

static void print_model(FILE *out, const ebpo_info *info)
{
    fprintf(out, "  mesh      %llu vertices, %llu faces, %s coordinates",
            (unsigned long long)info->vertex_count, (unsigned long long)info->face_count,
            info->double_coordinates ? "double" : "float");
    if (!(info->parts & EBPO_PART_MESH))
        fputs(" (not in this file)", out);
    if (info->solid) {
        char text[FINDINGS_VOLUME], extent[40];
        ebpo_solid_volume solid = facts_solid(info, NULL);
        findings_extent(extent, sizeof extent, solid.integral, 3, &info->report);
        /* true: the text contains the volume as one number; false: it contains an interval or no
         * volume */
        bool printed =
            findings_volume_known(&solid) && (isnormal(solid.integral) || extent[0] == '0');
        fprintf(out, "\n  solid     %s%s, by winding number, rule %s",
                findings_volume(text, &solid, &info->report, info->unit),
                printed ? "" : " (see ebpo measure)", words_rule(info->rule));
    }
    if (info->parts & EBPO_PART_BORDER)
        print_border(out, info);
    if (info->parts & EBPO_PART_SURFACE)
        print_surface(out, info);
    if (facts_inside_out(info))
        fprintf(out, "\n  warning   %s", facts_inside_out(info));
    fprintf(out, "\n  box       %.6g %.6g %.6g, size %.6g %.6g %.6g%s%s\n", info->box_origin[0],
            info->box_origin[1], info->box_origin[2], info->box_size[0], info->box_size[1],
            info->box_size[2], info->unit[0] ? " " : "", info->unit);
    if (info->crs[0])
        fprintf(out, "  crs       %s\n", info->crs);
    if (info->date[0])
        fprintf(out, "  date      %s\n", info->date);
    fprintf(out, "  built by  %s: maximum level %d, leaf faces %u, ", info->generator,
            info->max_level, info->leaf_faces);
    const ebpo_selection_traits *traits = ebpo_selection_describe((ebpo_selection)info->selection);
    if (!traits)
        fputs("unknown selection of planes\n", out);
    else if (!traits->from_leaves && info->selection != EBPO_SELECT_INHERIT)
        fprintf(out, "selection %s, epsilon %g\n", traits->name, info->epsilon);
    else if (!traits->from_leaves)
        fprintf(out, "epsilon %g\n", info->epsilon);
    else if (info->k_root > 0)
        fprintf(out, "selection %s, K %.10g at the root\n", traits->name, info->k_root);
    else
        fprintf(out, "selection %s, %.10g %%\n", traits->name, info->percent);
}

uint64_t facts_white(const ebpo_info *info, int level)
{
    return info->level[level].white_count - (level ? 8 * info->level[level - 1].pruned_count : 0);
}

static uint64_t pruned_nodes(const ebpo_info *info)
{
    uint64_t sum = 0;
    for (int i = 0; i < info->level_count; i++)
        sum += info->level[i].pruned_count;
    return sum;
}

static void print_subset(FILE *out, const ebpo_info *info)
{
    const double *b = info->kept_box;
    char hex[65], pruned[40];
    words_hex(info->subset_of, hex);
    fputs("  subset   ", out);
    if (info->cut_levels)
        fprintf(out, " levels 0 to %d", info->cut_levels - 1);
    if (info->boxed)
        fprintf(out, "%s the part in box %.9g,%.9g,%.9g,%.9g,%.9g,%.9g",
                info->cut_levels ? "," : "", b[0], b[1], b[2], b[3], b[4], b[5]);
    if (info->kept_error > 0)
        fprintf(out, "%s pruned where envelopes extend at most %.9g beyond the model",
                info->cut_levels || info->boxed ? "," : "", info->kept_error);
    fprintf(out, "; nothing below %s;\n            taken from the file with content_sha256 %s\n",
            words_plural(pruned, sizeof pruned, pruned_nodes(info), "pruned node", "pruned nodes"),
            hex);
}

static uint64_t level_bytes(const ebpo_info *info, const ebpo_stored_sizes *stored)
{
    uint64_t sum = 0;
    for (int i = 0; i < info->level_count; i++)
        sum += stored->level_bytes[i];
    return sum;
}

/* Returns the number of bytes in the file that belong to no known part: 0 unless another program
 * has written the file. */
static uint64_t other_bytes(const ebpo_info *info, const ebpo_stored_sizes *stored)
{
    uint64_t sum = info->head_bytes + info->chunk_index_bytes + level_bytes(info, stored) +
                   stored->mesh_vertex_bytes + stored->mesh_face_bytes + stored->map_bytes +
                   stored->subtree_bytes + stored->attribute_bytes + stored->border_bytes +
                   stored->surface_bytes + stored->checksum_bytes;
    return info->file_bytes > sum ? info->file_bytes - sum : 0;
}

static void print_bytes(FILE *out, const char *label, const ebpo_info *info, uint64_t bytes)
{
    char text[32];
    if (bytes == 0)
        return;
    fprintf(out, "            %-9s %9s %6.1f %%", label, words_bytes(text, sizeof text, bytes),
            info->file_bytes ? 100 * (double)bytes / (double)info->file_bytes : 0);
    if (info->face_count)
        fprintf(out, " %8.3f B/face", (double)bytes / (double)info->face_count);
    fputc('\n', out);
}

void facts_print(FILE *out, const char *path, const ebpo_info *info,
                 const ebpo_stored_sizes *stored)
{
    char bytes[32], parts[64], version[32];
    fprintf(out, "%s: EBP-Octree %s, %s, levels 0 to %d, %s\n", path,
            words_format(version, sizeof version, info->version_major, info->version_minor),
            info->solid ? "a solid" : "a surface", info->level_count - 1,
            words_bytes(bytes, sizeof bytes, info->file_bytes));
    print_source(out, info);
    if (info->pruned)
        print_subset(out, info);
    findings_print_repair(out, &info->repair_record);
    print_model(out, info);
    fprintf(out, "  holds     %s; codec %s%s\n", words_parts(parts, sizeof parts, info->parts),
            words_codec(info->codec), info->gates ? "; faces coded as gates" : "");
    if (info->subtree_level)
        fprintf(out, "  subtrees  %llu below level %d, each to be read at once\n",
                (unsigned long long)info->level[info->subtree_level].gray_count,
                info->subtree_level);
    print_bytes(out, "head", info, info->head_bytes);
    print_bytes(out, "index", info, info->chunk_index_bytes);
    print_bytes(out, "levels", info, level_bytes(info, stored));
    print_bytes(out, "vertices", info, stored->mesh_vertex_bytes);
    print_bytes(out, "faces", info, stored->mesh_face_bytes);
    print_bytes(out, "maps", info, stored->map_bytes);
    print_bytes(out, "subtrees", info, stored->subtree_bytes);
    print_bytes(out, "attributes", info, stored->attribute_bytes);
    print_bytes(out, "border", info, stored->border_bytes);
    print_bytes(out, "surface", info, stored->surface_bytes);
    print_bytes(out, "checksums", info, stored->checksum_bytes);
    print_bytes(out, "other", info, other_bytes(info, stored));
    print_bytes(out, "file", info, info->file_bytes);
}

void facts_table(FILE *out, const ebpo_info *info, const ebpo_stored_sizes *stored)
{
    char whole[TABLE_CELL];
    ebpo_solid_volume solid = facts_solid(info, NULL);
    snprintf(whole, sizeof whole, "%% %s", facts_whole(info, &solid));
    fprintf(out, "%5s %9s %9s %9s %9s %9s %10s %12s %9s %10s %10s\n", "level", "gray", "leaf",
            "white", "black", "planes", "faces new", "faces again", "stored", "cumulative", whole);
    for (int i = 0; i < info->level_count; i++) {
        const ebpo_level_summary *l = &info->level[i];
        char taken[32], sum[32], percent[TABLE_CELL];
        fprintf(out, "%5d %9llu %9llu %9llu %9llu %9llu %10llu %12llu %9s %10s %10s\n", i,
                (unsigned long long)l->gray_count, (unsigned long long)l->leaf_count,
                (unsigned long long)facts_white(info, i), (unsigned long long)l->black_count,
                (unsigned long long)(l->plane_count + l->leaf_plane_count),
                (unsigned long long)l->new_count, (unsigned long long)l->ref_count,
                words_bytes(taken, sizeof taken, stored->level_bytes[i]),
                words_bytes(sum, sizeof sum, facts_cumulative(info, stored, i)),
                table_cell(percent, "%.2f", facts_percent(info, &solid, i)));
    }
    table_legend(out);
    facts_print_whole(out, info, &solid);
    if (!isfinite(facts_percent(info, &solid, 0)))
        table_beyond(out);
}

/* Writes the type of an array's elements, such as "u32". */
static const char *element_word(char word[8], const ebpo_array_facts *a)
{
    snprintf(word, 8, "%c%u", a->is_signed ? 'i' : 'u', 8 * a->element_bytes % 1000);
    return word;
}

void facts_arrays(FILE *out, const ebpo_file *file)
{
    ebpo_array_facts a = EBPO_ARRAY_FACTS_INIT;
    fprintf(out, "\n%-28s %4s %12s %4s %10s  %s\n", "array", "type", "rows", "cols", "stored",
            "about");
    for (unsigned n = 0; ebpo_file_array(file, n, &a); n++) {
        char word[8], stored[32];
        fprintf(out, "%-28s %4s %12llu %4u %10s  %s\n", a.path, element_word(word, &a),
                (unsigned long long)a.rows, a.columns,
                words_bytes(stored, sizeof stored, a.stored_bytes), a.about);
    }
}

void facts_attributes(FILE *out, const ebpo_file *file)
{
    ebpo_attribute_facts a = EBPO_ATTRIBUTE_FACTS_INIT;
    for (unsigned n = 0; ebpo_file_attribute(file, n, &a); n++) {
        char stored[32];
        fprintf(out, "  %s %-9s %s", n ? "           " : "attributes", a.element, a.names);
        fprintf(out, ", %s%s", a.list ? "lists of " : "", ebpo_attribute_type_text(a.type));
        if (a.has_range)
            fprintf(out, ", %.9g to %.9g", a.range[0], a.range[1]);
        fprintf(out, ", %s\n", words_bytes(stored, sizeof stored, a.stored_bytes));
    }
}

/* --- JSON --- */

void facts_attributes_json(json *j, const ebpo_file *file)
{
    ebpo_attribute_facts a = EBPO_ATTRIBUTE_FACTS_INIT;
    json_array(j, "attributes");
    for (unsigned n = 0; ebpo_file_attribute(file, n, &a); n++) {
        json_object(j, NULL);
        json_text(j, "element", a.element);
        json_text(j, "names", a.names);
        json_text(j, "type", ebpo_attribute_type_text(a.type));
        json_bool(j, "list", a.list);
        json_uint(j, "rows", a.rows);
        json_uint(j, "columns", a.columns);
        if (a.has_range)
            json_reals(j, "range", a.range, 2);
        json_uint(j, "stored_bytes", a.stored_bytes);
        json_end(j);
    }
    json_end(j);
}

void facts_arrays_json(json *j, const ebpo_file *file)
{
    ebpo_array_facts a = EBPO_ARRAY_FACTS_INIT;
    json_array(j, "arrays");
    for (unsigned n = 0; ebpo_file_array(file, n, &a); n++) {
        char word[8];
        json_object(j, NULL);
        json_text(j, "path", a.path);
        json_text(j, "type", element_word(word, &a));
        json_uint(j, "rows", a.rows);
        json_uint(j, "columns", a.columns);
        json_uint(j, "stored_bytes", a.stored_bytes);
        json_text(j, "coding", a.coding);
        json_text(j, "about", a.about);
        json_end(j);
    }
    json_end(j);
}

static void json_level(json *j, const ebpo_info *info, const ebpo_stored_sizes *stored,
                       const ebpo_solid_volume *solid, int number)
{
    char percent[32];
    const ebpo_level_summary *l = &info->level[number];
    json_object(j, NULL);
    json_int(j, "level", number);
    json_uint(j, "gray", l->gray_count);
    json_uint(j, "leaf", l->leaf_count);
    if (info->pruned)
        json_uint(j, "pruned", l->pruned_count);
    json_uint(j, "white", facts_white(info, number));
    json_uint(j, "black", l->black_count);
    json_uint(j, "planes", l->plane_count);
    json_uint(j, "leaf_planes", l->leaf_plane_count);
    json_uint(j, "faces_new", l->new_count);
    json_uint(j, "faces_again", l->ref_count);
    json_uint(j, "stored_bytes", stored->level_bytes[number]);
    json_uint(j, "cumulative_bytes", facts_cumulative(info, stored, number));
    json_real(j, "gray_volume", l->gray_volume);
    json_real(j, "leaf_volume", l->leaf_volume);
    json_real(j, "envelope_volume", facts_volume(info, number));
    snprintf(percent, sizeof percent, "percent_of_%s", facts_whole(info, solid));
    json_real(j, percent, facts_percent(info, solid, number));
    json_end(j);
}

static void json_source(json *j, const ebpo_info *info)
{
    char hex[65];
    words_hex(info->source_sha256, hex);
    json_object(j, "source");
    json_text(j, "name", info->source_name);
    json_text(j, "format", info->source_format);
    json_uint(j, "bytes", info->source_size);
    json_text(j, "sha256", hex);
    json_uint(j, "vertices", info->source_vertex_count);
    json_uint(j, "faces", info->source_face_count);
    json_end(j);
}

static void json_model(json *j, const ebpo_info *info)
{
    json_text(j, "kind", info->solid ? "solid" : "surface");
    json_bool(j, "inside_out", facts_inside_out(info) != NULL);
    json_bool(j, "envelopes_contain_inside", info->solid || info->border_inside);
    json_text(j, "rule", words_rule(info->rule));
    json_uint(j, "vertices", info->vertex_count);
    json_uint(j, "faces", info->face_count);
    json_bool(j, "double_coordinates", info->double_coordinates);
    json_text(j, "unit", info->unit);
    json_text(j, "crs", info->crs);
    json_text(j, "date", info->date);
    json_reals(j, "box_origin", info->box_origin, 3);
    json_reals(j, "box_size", info->box_size, 3);
    json_int(j, "grid_level", info->grid_level);
    json_int(j, "max_level", info->max_level);
    json_uint(j, "leaf_faces", info->leaf_faces);
    json_real(j, "epsilon", info->epsilon);
    json_text(j, "selection", info->selection < 0 ? "unknown" : selection_words[info->selection]);
    if (info->selection <= EBPO_SELECT_INHERIT)
        return;
    json_real(j, "percent", info->percent);
    json_real(j, "k_root", info->k_root);
    json_text(j, "normals", info->normals < 0 ? "unknown" : normals_words[info->normals]);
    json_uint(j, "seed", info->seed);
}

static void json_subset(json *j, const ebpo_info *info)
{
    char hex[65];
    if (!info->pruned)
        return;
    words_hex(info->subset_of, hex);
    json_object(j, "subset");
    json_text(j, "of_content_sha256", hex);
    if (info->cut_levels)
        json_int(j, "last_level", info->cut_levels - 1);
    if (info->boxed)
        json_reals(j, "box", info->kept_box, 6);
    if (info->kept_error > 0)
        json_real(j, "max_error", info->kept_error);
    json_uint(j, "pruned_nodes", pruned_nodes(info));
    json_end(j);
}

static void json_border(json *j, const ebpo_info *info)
{
    if (!(info->parts & EBPO_PART_BORDER))
        return;
    json_object(j, "border");
    json_uint(j, "loops", info->border_loops);
    json_uint(j, "edges", info->border_points);
    json_uint(j, "longest", info->border_longest);
    json_real(j, "cap_area", info->border_area);
    json_end(j);
}

static void json_surface(json *j, const ebpo_info *info)
{
    if (!(info->parts & EBPO_PART_SURFACE))
        return;
    json_object(j, "surface");
    json_uint(j, "patches", info->surface_patches);
    json_uint(j, "triangles", info->surface_triangles);
    json_uint(j, "vertices", info->surface_vertices);
    json_end(j);
}

static void json_storage(json *j, const ebpo_info *info, const ebpo_stored_sizes *stored)
{
    char hex[65];
    words_hex(info->content_sha256, hex);
    json_array(j, "parts");
    for (int i = 0; part_words[i]; i++)
        if (info->parts >> i & 1)
            json_text(j, NULL, part_words[i]);
    json_end(j);
    json_text(j, "codec", words_codec(info->codec));
    if (info->parts & EBPO_PART_MESH)
        json_text(j, "face_coding", info->gates ? "gates" : "high-water");
    json_border(j, info);
    json_surface(j, info);
    json_subset(j, info);
    json_text(j, "content_sha256", hex);
    json_object(j, "bytes");
    json_uint(j, "file", info->file_bytes);
    json_uint(j, "head", info->head_bytes);
    json_uint(j, "index", info->chunk_index_bytes);
    json_uint(j, "levels", level_bytes(info, stored));
    json_uint(j, "vertices", stored->mesh_vertex_bytes);
    json_uint(j, "faces", stored->mesh_face_bytes);
    json_uint(j, "maps", stored->map_bytes);
    json_uint(j, "subtrees", stored->subtree_bytes);
    json_uint(j, "attributes", stored->attribute_bytes);
    json_uint(j, "border", stored->border_bytes);
    json_uint(j, "surface", stored->surface_bytes);
    json_uint(j, "chunk_checksums", stored->checksum_bytes);
    json_uint(j, "other", other_bytes(info, stored));
    json_end(j);
    if (!info->subtree_level)
        return;
    json_object(j, "subtrees");
    json_int(j, "level", info->subtree_level);
    json_uint(j, "count", info->level[info->subtree_level].gray_count);
    json_uint(j, "top_bytes", info->top_bytes);
    json_end(j);
}

void facts_json(json *j, const char *path, const ebpo_info *info, const ebpo_stored_sizes *stored,
                const ebpo_shells *shells)
{
    ebpo_solid_volume solid = facts_solid(info, shells);
    char version[32];
    json_text(j, "file", path);
    json_text(j, "format",
              words_format(version, sizeof version, info->version_major, info->version_minor));
    json_text(j, "generator", info->generator);
    json_source(j, info);
    json_model(j, info);
    findings_json_repair(j, "repair", &info->repair_record);
    findings_json(j, "report", &info->report, &solid);
    json_storage(j, info, stored);
    json_array(j, "levels");
    for (int i = 0; i < info->level_count; i++)
        json_level(j, info, stored, &solid, i);
    json_end(j);
}

const char *facts_no_surface(const ebpo_info *info)
{
    enum { LEAST_FACES = 2048 }; /* format-spec/surface.md */
    return info->pruned                      ? "subsets get none"
           : !(info->parts & EBPO_PART_MESH) ? "files without their mesh get none"
           : info->face_count < LEAST_FACES
               ? "models with fewer than 2,048 faces get none"
               : "its error cannot be bounded well: the faces are tiny for the model, or the model "
                 "is tiny for its distance from the origin or for doubles";
}
