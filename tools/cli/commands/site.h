/* What a server of the web viewer serves: the files of the viewer, models, and their pictures. */
#ifndef EBPO_TOOLS_SITE_H
#define EBPO_TOOLS_SITE_H

#include <stddef.h>

#include "cli/json.h"
#include "cli/serve/http_server.h"

typedef struct site_options {
    const char *command; /* name of the command, for messages */
    const char *viewer;  /* folder of the viewer; NULL: as installed */
    const char *query;   /* added to the query of the first page of a single model; NULL: nothing */
    int64_t max_expansion;
} site_options;

typedef struct site site;

/* Makes a site without models. Returns NULL after an error, reported on stderr. */
site *site_new(const site_options *options);

/* Adds a model, or all models below a folder. Returns an exit code; errors are reported. */
int site_add(site *s, const char *path);

/* Makes the first page that of a scene, whose models are those of the site. text: of the scene
 * file, with the addresses models/NUMBER/FILE of models. Takes ownership of `text`. Returns an exit
 * code. */
int site_show_scene(site *s, char *text);

/* Completes the site after the last model: adds the files of the viewer and the list of models,
 * and selects the first page. Returns an exit code; errors are reported. */
int site_finish(site *s);

/* An http_find_fn, whose `user` is a site. */
int site_find(void *user, const char *path, bool has_query, http_content *out);

size_t site_model_count(const site *s);

/* Prints an array of the models. for_viewer: with their addresses instead of their paths. */
void site_print_models(const site *s, json *j, bool for_viewer);

/* Frees the site, which may be NULL. */
void site_free(site *s);

#endif
