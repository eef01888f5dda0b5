#include "processor.h"

#include "query/query_model.h"

void processor_is_base(ebpo_model *model, bool base)
{
    model->kernels = base ? ebpo_query_kernels_base() : ebpo_query_kernels_best();
}
