/* Opens the operands of a Boolean expression: models, and the instances of scenes. */
#ifndef EBPO_TOOLS_BOOLEAN_OPERANDS_H
#define EBPO_TOOLS_BOOLEAN_OPERANDS_H

#include <ebpo/boolean.h>
#include <ebpo/scene.h>

#include "cli/boolean_args.h"
#include "cli/query_args.h"

/* Maximum number of operands: one for each letter. */
enum { BOOLEAN_OPERANDS = 26 };

/* A file of the command line: a model or a scene. */
typedef struct boolean_input {
    const char *path;
    ebpo_scene *scene;     /* NULL: the file is a model */
    query_session session; /* the open model, if the file is a model */
    uint32_t first, count; /* index of the file's first operand; number of the file's operands */
} boolean_input;

typedef struct boolean_operands {
    boolean_input input[BOOLEAN_OPERANDS];
    uint32_t inputs; /* number of files */
    ebpo_boolean_operand operand[BOOLEAN_OPERANDS];
    const char *shown[BOOLEAN_OPERANDS]; /* path of the model, or name of the instance */
    uint32_t count;                      /* number of operands */
    bool raises_memory; /* large models may use more memory than model_options.memory */
    /* maximum memory of a model that needs more than model_options.memory; 0: no model gets more */
    uint64_t memory_max;
} boolean_operands;

/* Lists the operands in the order of the paths, which end with NULL. A path is a model, or a scene
 * (NAME.json). A scene gives one operand for each of its instances, with the instance's pose at the
 * scene's first time. Models are not opened. Returns an exit code; errors have been reported on
 * stderr. Call boolean_operands_close in any case. */
int boolean_operands_list(boolean_operands *o, const char *name, const char **paths);

/* Opens the models. model_options: options for each model. Returns an exit code. */
int boolean_operands_open(boolean_operands *o, const char *name,
                          const ebpo_model_options *model_options, const remote_values *remote);
void boolean_operands_close(boolean_operands *o);

/* Returns the unit of the first operand of an expression that has a unit and is not scaled by its
 * pose, or NULL. The models are open. */
const char *boolean_operands_unit(const boolean_operands *o, const boolean_nodes *nodes);

/* Returns true, after an error message, if the output is a file of the operands: a model, a scene,
 * or a model of a scene. The caller then exits with EXIT_USAGE. */
bool boolean_operands_overwrite(const boolean_operands *o, const char *name, const char *out);

#endif
