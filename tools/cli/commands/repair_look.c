#include "cli/commands/repair_look.h"

#include <stdio.h>
#include <string.h>

#include "cli/commands/unlisted.h"

ebpo_read_options patient_reading(const patient *p)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = p->threads;
    read.workspace = p->workspace;
    return read;
}

/* A failure that says something about the file and not about this machine. */
static bool is_damage(ebpo_status status)
{
    return status == EBPO_E_FORMAT || status == EBPO_E_VERSION || status == EBPO_E_LIMIT ||
           status == EBPO_E_ABSENT;
}

/* What came of reading a part. */
static ebpo_status take_down(patient *p, piece which, ebpo_status status, const ebpo_error *told,
                             ebpo_error *error)
{
    if (status == EBPO_OK || is_damage(status)) {
        p->fate[which] = status == EBPO_OK ? KEPT : LOST;
        if (status != EBPO_OK && !p->why[which][0])
            snprintf(p->why[which], sizeof p->why[which], "%s", told->message);
        return EBPO_OK;
    }
    *error = *told;
    return status;
}

static ebpo_status look_at_mesh(patient *p, ebpo_error *error)
{
    ebpo_error told = EBPO_ERROR_INIT;
    ebpo_read_options read = patient_reading(p);
    ebpo_mesh mesh = { 0 };
    ebpo_maps maps = { 0 };
    if (!(p->info->parts & EBPO_PART_MESH))
        return EBPO_OK;
    ebpo_status status = ebpo_file_read_mesh(p->file, &read, &mesh, &told);
    ebpo_mesh_free(&mesh);
    status = take_down(p, MESH, status, &told, error);
    if (status != EBPO_OK || !(p->info->parts & EBPO_PART_MAPS))
        return status;
    status = ebpo_file_read_maps(p->file, &read, &maps, &told);
    ebpo_maps_free(&maps);
    return take_down(p, MAPS, status, &told, error);
}

/* The header that they share comes with all of them. */
static ebpo_status look_at_header(patient *p, ebpo_error *error)
{
    ebpo_error told = EBPO_ERROR_INIT;
    ebpo_read_options read = patient_reading(p);
    ebpo_mesh mesh = { 0 };
    if (p->fate[MESH] != KEPT)
        return EBPO_OK;
    read.attributes = true;
    ebpo_status status = ebpo_file_read_mesh(p->file, &read, &mesh, &told);
    ebpo_mesh_free(&mesh);
    return take_down(p, ATTRIBUTES, status, &told, error);
}

static ebpo_status look_at_attributes(patient *p, ebpo_error *error)
{
    ebpo_error told = EBPO_ERROR_INIT;
    ebpo_read_options read = patient_reading(p);
    ebpo_status status = EBPO_OK;
    if (!(p->info->parts & EBPO_PART_ATTRIBUTES))
        return EBPO_OK;
    p->fate[ATTRIBUTES] = KEPT;
    status = look_at_header(p, error);
    for (unsigned n = 0; status == EBPO_OK && p->fate[ATTRIBUTES] == KEPT; n++) {
        ebpo_attribute_values got;
        status = ebpo_file_read_attribute(p->file, n, &read, &got, &told);
        ebpo_attribute_values_free(&got);
        if (status == EBPO_E_ABSENT) /* that was the last one */
            return EBPO_OK;
        status = take_down(p, ATTRIBUTES, status, &told, error);
    }
    return status;
}

static ebpo_status look_at_levels(patient *p, ebpo_error *error)
{
    ebpo_error told = EBPO_ERROR_INIT;
    ebpo_read_options read = patient_reading(p);
    ebpo_status status = EBPO_OK;
    p->fate[LEVELS] = KEPT;
    for (int l = 0; l < p->info->level_count && status == EBPO_OK; l++) {
        ebpo_level level;
        status = ebpo_file_read_level(p->file, l, &read, &level, &told);
        bool good = status == EBPO_OK;
        if (good)
            ebpo_level_free(&level);
        status = good ? EBPO_OK : take_down(p, LEVELS, status, &told, error);
    }
    return status;
}

static void forget(patient *p)
{
    memset(p->fate, 0, sizeof p->fate);
    memset(p->why, 0, sizeof p->why);
}

static ebpo_status look_at_all(patient *p, ebpo_error *error)
{
    forget(p);
    ebpo_status status = look_at_mesh(p, error);
    if (status == EBPO_OK)
        status = look_at_attributes(p, error);
    return status == EBPO_OK ? look_at_levels(p, error) : status;
}

/* Opens it without its list, if its content is then that of the head. */
static ebpo_status open_unlisted(const patient *p, ebpo_file **out, ebpo_error *error)
{
    ebpo_read_options read = patient_reading(p);
    ebpo_status status = unlisted_open(p->path, p->most_expansion, out, error);
    return status == EBPO_OK ? ebpo_file_check_content(*out, &read, error) : status;
}

/* Nothing can be read without the list of how chunks end. Where it is what is damaged, and nothing
 * else, the content without it is that of the head: that is a proof, so all of it is kept. */
ebpo_status patient_look(patient *p, ebpo_error *error)
{
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ebpo_error told = EBPO_ERROR_INIT;
    ebpo_file *unlisted = NULL;
    ebpo_status status = look_at_all(p, error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(p->file, &stored, error);
    if (status != EBPO_OK || !stored.sum_bytes)
        return status;
    p->fate[SUMS] = KEPT;
    if (p->fate[MESH] != LOST)
        return EBPO_OK;
    status = open_unlisted(p, &unlisted, &told);
    if (status != EBPO_OK) {
        ebpo_close(unlisted);
        *error = told;
        return is_damage(status) ? EBPO_OK : status;
    }
    char why[sizeof p->why[MESH]];
    memcpy(why, p->why[MESH], sizeof why);
    ebpo_close(p->file);
    p->file = unlisted;
    p->info = ebpo_file_info(unlisted);
    status = look_at_all(p, error);
    p->fate[SUMS] = REBUILT;
    memcpy(p->why[SUMS], why, sizeof why);
    return status;
}
