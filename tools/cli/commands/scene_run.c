/* What a scene holds, where that is, and which of its instances may meet. */
#include "cli/commands/scene_run.h"

#include <stdio.h>

#include "cli/json.h"
#include "cli/words.h"

/* Bytes of the files of models, each counted once. */
typedef struct sums {
    uint64_t bytes, faces, posed_faces;
} sums;

static sums add_up(const ebpo_scene *scene, uint64_t models)
{
    sums s = { 0 };
    for (uint64_t i = 0; i < models; i++) {
        ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
        const ebpo_file *file = ebpo_scene_file(scene, i);
        (void)ebpo_scene_get_model(scene, i, &m);
        bool first = true;
        for (uint64_t k = 0; k < i && first; k++)
            first = ebpo_scene_file(scene, k) != file;
        s.bytes += first ? ebpo_file_info(file)->file_bytes : 0;
        s.faces += first ? ebpo_file_info(file)->face_count : 0;
        s.posed_faces += ebpo_file_info(file)->face_count * m.instances;
    }
    return s;
}

static void info_json(const char *path, const ebpo_scene *scene, const ebpo_scene_counts *c,
                      double box[2][3])
{
    json j;
    sums s = add_up(scene, c->models);
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "scene", path);
    json_uint(&j, "instances", c->instances);
    json_uint(&j, "fixed", c->fixed);
    json_uint(&j, "layers", c->layers);
    json_uint(&j, "groups", c->groups);
    json_uint(&j, "routes", c->routes);
    json_uint(&j, "poses", c->poses);
    json_uint(&j, "cameras", c->cameras);
    json_uint(&j, "ignored", c->ignored);
    json_uint(&j, "clearances", c->clearances);
    json_real(&j, "begin", c->begin);
    json_real(&j, "end", c->end);
    json_reals(&j, "min", box[0], 3);
    json_reals(&j, "max", box[1], 3);
    json_uint(&j, "bytes", s.bytes);
    json_uint(&j, "faces", s.faces);
    json_uint(&j, "posed_faces", s.posed_faces);
    json_array(&j, "models");
    for (uint64_t i = 0; i < c->models; i++) {
        ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
        (void)ebpo_scene_get_model(scene, i, &m);
        json_object(&j, NULL);
        json_text(&j, "name", m.name);
        json_text(&j, "file", m.path);
        json_uint(&j, "instances", m.instances);
        json_uint(&j, "faces", ebpo_file_info(ebpo_scene_file(scene, i))->face_count);
        json_uint(&j, "bytes", ebpo_file_info(ebpo_scene_file(scene, i))->file_bytes);
        json_reals(&j, "min", m.min, 3);
        json_reals(&j, "max", m.max, 3);
        json_end(&j);
    }
    json_finish(&j);
}

static void info_words(const char *path, const ebpo_scene *scene, const ebpo_scene_counts *c,
                       double box[2][3])
{
    sums s = add_up(scene, c->models);
    printf("%s: %llu instances of %llu models\n", path, (unsigned long long)c->instances,
           (unsigned long long)c->models);
    printf("fixed      %llu\nlayers     %llu\ngroups     %llu\nroutes     %llu, %llu poses\n",
           (unsigned long long)c->fixed, (unsigned long long)c->layers,
           (unsigned long long)c->groups, (unsigned long long)c->routes,
           (unsigned long long)c->poses);
    printf("cameras    %llu\nignored    %llu\nclearances %llu\n", (unsigned long long)c->cameras,
           (unsigned long long)c->ignored, (unsigned long long)c->clearances);
    printf("time       %g to %g\n", c->begin, c->end);
    printf("box        %.9g %.9g %.9g to %.9g %.9g %.9g\n", box[0][0], box[0][1], box[0][2],
           box[1][0], box[1][1], box[1][2]);
    printf("faces      %llu in files, %llu in the scene\nbytes      %llu\n\n",
           (unsigned long long)s.faces, (unsigned long long)s.posed_faces,
           (unsigned long long)s.bytes);
    printf("%9s %11s %12s  model\n", "instances", "faces", "bytes");
    for (uint64_t i = 0; i < c->models; i++) {
        ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
        const ebpo_info *info = ebpo_file_info(ebpo_scene_file(scene, i));
        (void)ebpo_scene_get_model(scene, i, &m);
        printf("%9llu %11llu %12llu  %s\n", (unsigned long long)m.instances,
               (unsigned long long)info->face_count, (unsigned long long)info->file_bytes, m.name);
    }
}

ebpo_status scene_info(const scene_values *v, const char *path, ebpo_scene *scene,
                       ebpo_error *error)
{
    double box[2][3];
    ebpo_scene_counts c = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(scene, &c);
    ebpo_status status = ebpo_scene_box(scene, c.begin, c.end, box[0], box[1], error);
    if (status == EBPO_OK)
        (v->json ? info_json : info_words)(path, scene, &c, box);
    return status;
}

/* All was checked while it was opened. */
ebpo_status scene_check(const scene_values *v, const char *path, ebpo_scene *scene,
                        ebpo_error *error)
{
    ebpo_scene_counts c = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(scene, &c);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < c.models && status == EBPO_OK; i++)
        status = ebpo_file_check_content(ebpo_scene_file(scene, i), NULL, error);
    if (status == EBPO_OK && v->json) {
        json j;
        json_begin(&j, stdout);
        json_object(&j, NULL);
        json_text(&j, "scene", path);
        json_uint(&j, "models", c.models);
        json_finish(&j);
    } else if (status == EBPO_OK && !v->quiet)
        printf("%s: fine: %llu models, all contents as their checksums say\n", path,
               (unsigned long long)c.models);
    return status;
}

ebpo_status scene_boxes(const scene_values *v, const char *path, ebpo_scene *scene,
                        ebpo_error *error)
{
    json j;
    ebpo_status status = EBPO_OK;
    ebpo_scene_instance instance = EBPO_SCENE_INSTANCE_INIT;
    (void)path;
    json_begin(&j, stdout);
    if (v->json) {
        json_object(&j, NULL);
        json_array(&j, "boxes");
    }
    for (uint64_t i = 0; ebpo_scene_get_instance(scene, i, &instance) == EBPO_OK; i++) {
        double min[3], max[3];
        status = ebpo_scene_instance_box(scene, i, v->from, v->to, min, max, error);
        if (status != EBPO_OK)
            return status;
        if (v->json) {
            json_object(&j, NULL);
            json_text(&j, "instance", instance.name);
            json_reals(&j, "min", min, 3);
            json_reals(&j, "max", max, 3);
            json_end(&j);
        } else {
            const double box[] = { min[0], min[1], min[2], max[0], max[1], max[2] };
            words_print_reals(box, 6, " ");
            printf("\t%s\n", instance.name);
        }
    }
    if (v->json)
        json_finish(&j);
    return status;
}

typedef struct pair_print {
    const scene_values *v;
    const ebpo_scene *scene;
    json j;
} pair_print;

static bool print_pairs(void *user, const ebpo_scene_pair *pairs, uint64_t count)
{
    pair_print *p = user;
    for (uint64_t i = 0; i < count; i++) {
        ebpo_scene_instance a = EBPO_SCENE_INSTANCE_INIT, b = EBPO_SCENE_INSTANCE_INIT;
        (void)ebpo_scene_get_instance(p->scene, pairs[i].a, &a);
        (void)ebpo_scene_get_instance(p->scene, pairs[i].b, &b);
        if (p->v->json) {
            json_object(&p->j, NULL);
            json_text(&p->j, "a", a.name);
            json_text(&p->j, "b", b.name);
            json_real(&p->j, "clearance", pairs[i].clearance);
            json_end(&p->j);
        } else {
            printf("%s\t%s\t%s\n", a.name, b.name, words_real(pairs[i].clearance, (char[32]){ 0 }));
        }
    }
    return true;
}

ebpo_status scene_pairs(const scene_values *v, const char *path, ebpo_scene *scene,
                        ebpo_error *error)
{
    pair_print p = { .v = v, .scene = scene };
    (void)path;
    json_begin(&p.j, stdout);
    if (v->json) {
        json_object(&p.j, NULL);
        json_array(&p.j, "pairs");
    }
    ebpo_status status = ebpo_scene_pairs(scene, v->from, v->to, print_pairs, &p, error);
    if (v->json)
        json_finish(&p.j);
    return status;
}
