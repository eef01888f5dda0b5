/* A model at a pose. Pure functions, any thread. */
#ifndef EBPO_COLLIDE_POSED_MODEL_H
#define EBPO_COLLIDE_POSED_MODEL_H

#include "geometry/pose.h"
#include "query/query_model.h"

/* No vertex of the model is beyond these coordinates, in size. */
void ebpo_model_reach(const ebpo_model *model, double reach[3]);

/* No posed coordinate of its vertices is greater in size. */
double ebpo_posed_reach(const ebpo_posing *posing, const double reach[3]);

/* One file, or two of the same content: the same faces, and the same is meant by them. */
bool ebpo_same_model(const ebpo_model *a, const ebpo_model *b);

#endif
