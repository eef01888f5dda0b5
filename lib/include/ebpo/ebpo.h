/* SPDX-License-Identifier: MIT
 * Includes the public interface of the core library.
 *
 *   base.h        versions, errors, progress, outputs, rules for all functions
 *   workspace.h   memory limits
 *   memory.h      available memory
 *   mesh.h        triangle meshes: reading, checking, repairing
 *   findings.h    locations of findings (possible defects of a mesh)
 *   repair.h      trying repairs that make a mesh solid
 *   groups.h      named groups of faces
 *   rows.h        rows of numbers from any HDF5 file
 *   colours.h     colours of vertices and faces
 *   build.h       building a tree from a mesh
 *   file.h        files: writing, opening, reading
 *   http.h        files on web servers
 *   async.h       files whose bytes arrive asynchronously
 *   query.h       point in solid, distance, rays, boxes, mass
 *   catalogue.h   queries of many models, or of the parts of one model, together
 *   pair.h        relation of two faces
 *   pose.h        pose of a model in the world
 *   stream.h      levels, coarse to fine
 *   view.h        nodes in the order of an observer
 *   subtree.h     a part of a model as plain arrays: nodes, envelopes, faces
 *   lod.h         a level as closed polygons
 *   export.h      levels and the mesh in other programs' formats
 *   subset.h      a smaller file from a file
 *   verify.h      verifying the guarantees of a file
 *   error_bound.h error bound of a level
 *   limit.h       least possible volume of convex envelopes, for comparison
 *
 * Extras: headers of functions that are built on queries. They are not installed if the library was
 * configured with -Dextras=disabled.
 *
 *   boolean.h     unions and differences of solids at poses: queries, volume, mesh
 *   collide.h     collision of two models
 *   scene.h       animated rigid instances of models
 *   map.h         maps of distances: on planes, on grids, between two scans
 *   haptic.h      haptic rendering at a steady rate
 *   paint.h       colours and notes on a model, in a separate file
 */
#ifndef EBPO_EBPO_H
#define EBPO_EBPO_H

#include <ebpo/base.h>
#include <ebpo/workspace.h>
#include <ebpo/memory.h>
#include <ebpo/mesh.h>
#include <ebpo/findings.h>
#include <ebpo/repair.h>
#include <ebpo/groups.h>
#include <ebpo/rows.h>
#include <ebpo/build.h>
#include <ebpo/file.h>
#include <ebpo/http.h>
#include <ebpo/async.h>
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
#include <ebpo/error_bound.h>
#include <ebpo/limit.h>
#include <ebpo/colours.h>

#endif
