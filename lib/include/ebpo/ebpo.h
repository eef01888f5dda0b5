/* EBP-Octree in HDF5: the whole public interface. */
#ifndef EBPO_EBPO_H
#define EBPO_EBPO_H

#include <ebpo/base.h>
#include <ebpo/mesh.h>
#include <ebpo/file.h>
#include <ebpo/build.h>
#include <ebpo/deviation.h>
#include <ebpo/export.h>
#include <ebpo/http.h>
#include <ebpo/limit.h>
#include <ebpo/lod.h>
#include <ebpo/query.h>
#include <ebpo/stream.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>
#include <ebpo/view.h>
#include <ebpo/workspace.h>

#endif
