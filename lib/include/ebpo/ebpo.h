/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: the public interface of the core.
 *
 *   base.h        versions, errors, progress, outputs
 *   workspace.h   how much memory the work may use
 *   memory.h      how much there is
 *   mesh.h        triangle meshes: reading, checking, mending
 *   places.h      where a mesh has what checking it finds
 *   repair.h      which repairs make a solid of a mesh
 *   groups.h      groups of faces that a file has names for
 *   rows.h        numbers from any HDF5 file
 *   colours.h     colours of vertices and faces
 *   build.h       from a mesh to a tree
 *   file.h        files: writing, opening, reading
 *   http.h        files on web servers
 *   query.h       point in solid, distance, rays, boxes, mass
 *   catalogue.h   many models that are asked as one, or the parts of one
 *   pair.h        how two faces lie to each other
 *   pose.h        where a model is in the world
 *   stream.h      levels, coarse to fine
 *   view.h        nodes in the order of an observer
 *   subtree.h     a part of a model as plain arrays: nodes, envelopes, faces
 *   lod.h         a level as closed polygons
 *   export.h      levels and the mesh in other programs' formats
 *   subset.h      a smaller file from a file
 *   verify.h      proving that a file keeps its promises
 *   deviation.h   how far a level reaches beyond the model
 *   limit.h       what no convex envelope can be better than
 *
 * What is built on queries has headers of its own, which are installed unless the library was
 * configured with -Dextras=disabled:
 *
 *   boolean.h     unions and differences of solids at poses, by query
 *   collide.h     two models that meet
 *   scene.h       models at many places, that move
 *   map.h         maps of distance: planes, grids, two scans
 *   touch.h       a hand that touches a model, at a steady rate
 *   paint.h       paint and notes on a model, in a file of their own
 *
 * base.h says what holds for every function.
 */
#ifndef EBPO_EBPO_H
#define EBPO_EBPO_H

#include <ebpo/base.h>
#include <ebpo/workspace.h>
#include <ebpo/memory.h>
#include <ebpo/mesh.h>
#include <ebpo/places.h>
#include <ebpo/repair.h>
#include <ebpo/groups.h>
#include <ebpo/rows.h>
#include <ebpo/build.h>
#include <ebpo/file.h>
#include <ebpo/http.h>
#include <ebpo/query.h>
#include <ebpo/catalogue.h>
#include <ebpo/pair.h>
#include <ebpo/pose.h>
#include <ebpo/stream.h>
#include <ebpo/view.h>
#include <ebpo/subtree.h>
#include <ebpo/lod.h>
#include <ebpo/export.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>
#include <ebpo/deviation.h>
#include <ebpo/limit.h>
#include <ebpo/colours.h>

#endif
