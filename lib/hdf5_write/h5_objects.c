#include "hdf5_write/h5_objects.h"

#include "core/error.h"
#include "hdf5_write/sink.h"

static ebpo_status told(const ebpo_h5_out *out, const char *object, bool good, const char *what,
                        ebpo_error *error)
{
    ebpo_error cause = EBPO_ERROR_INIT;
    if (out->sink && ebpo_h5_sink_status(out->sink, error) != EBPO_OK)
        return out->sink->status;
    if (good)
        return EBPO_OK;
    (void)ebpo_h5_fail(&cause, ebpo_h5_short_of_memory() ? EBPO_E_MEMORY : EBPO_E_IO, out->shown,
                       object, what);
    if (out->sink)
        ebpo_h5_sink_fail(out->sink, &cause);
    return ebpo_fail_with(error, &cause);
}

ebpo_status ebpo_h5_created(const ebpo_h5_out *out, ebpo_error *error)
{
    return told(out, "", out->file >= 0, "libhdf5 could not create the file", error);
}

ebpo_status ebpo_h5_written(const ebpo_h5_out *out, const char *what, bool good, ebpo_error *error)
{
    return told(out, what, good, "libhdf5 could not write", error);
}

void ebpo_h5_close_list(hid_t list)
{
    if (list >= 0)
        H5Pclose(list);
}

void ebpo_h5_close_space(hid_t space)
{
    if (space >= 0)
        H5Sclose(space);
}

ebpo_status ebpo_h5_put_group(const ebpo_h5_out *out, const char *path, hid_t gcpl, bool good,
                              ebpo_h5_id *id, ebpo_error *error)
{
    *id = good ? H5Gcreate2(out->file, path, H5P_DEFAULT, gcpl, H5P_DEFAULT) : -1;
    ebpo_status status = ebpo_h5_written(out, path, *id >= 0, error);
    ebpo_h5_close_list(gcpl);
    return status;
}

ebpo_status ebpo_h5_put_dataset(const ebpo_h5_out *out, const char *path, hid_t type, hid_t space,
                                hid_t dcpl, bool good, ebpo_h5_id *id, ebpo_error *error)
{
    *id = good ? H5Dcreate2(out->file, path, type, space, H5P_DEFAULT, dcpl, H5P_DEFAULT) : -1;
    ebpo_status status = ebpo_h5_written(out, path, *id >= 0, error);
    ebpo_h5_close_space(space);
    ebpo_h5_close_list(dcpl);
    return status;
}

ebpo_status ebpo_h5_put_attribute(const ebpo_h5_out *out, hid_t object, const char *name,
                                  hid_t type, hid_t space, hid_t memory, const void *value,
                                  ebpo_error *error)
{
    hid_t attribute = -1;
    if (type >= 0 && space >= 0) {
        if (H5Aexists(object, name) > 0)
            attribute = H5Aopen(object, name, H5P_DEFAULT);
        else
            attribute = H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    }
    bool good = attribute >= 0 && H5Awrite(attribute, memory < 0 ? type : memory, value) >= 0;
    ebpo_status status = ebpo_h5_written(out, name, good, error);
    if (attribute >= 0 && H5Aclose(attribute) < 0 && status == EBPO_OK)
        status = ebpo_h5_written(out, name, false, error);
    ebpo_h5_close_space(space);
    return status;
}
