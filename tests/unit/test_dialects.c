/* Tests small files as other programs write them. The tables state which files are read, with
 * which warning, and which files are refused, with which message. docs/guide/formats.md describes
 * the same rules. */
#include <stdio.h>
#include <string.h>

#include <ebpo/mesh.h>

#include "check_main.h"
#include "scratch.h"
#include "solids.h"

typedef struct dialect {
    const char *name, *text;
    size_t bytes;
    uint64_t vertices, faces; /* 0: the file is refused */
    const char *words;        /* text of the error or the warning; NULL: no warning */
} dialect;

#define FILE_OF(text) text, sizeof(text) - 1

#define V4   "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
#define F4   "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
#define OFF4 "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
#define OFFF "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
#define HEAD_OF(vertices)                                                                          \
    "format ascii 1.0\nelement vertex " vertices "\nproperty float x\nproperty float y\nproperty " \
    "float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
#define HEAD4 HEAD_OF("4")
#define PLY4  "ply\n" HEAD4
#define PLY5  "ply\n" HEAD_OF("5")
#define LFS                                                                               \
    "version https://git-lfs.github.com/spec/v1\noid sha256:5c4b3f3c3e8b1a3a1ed3e6f87ee3" \
    "da8cbfd66e2c9e7b0a4d2b6a3ccd1f8a0d11\nsize 12345678\n"
#define FACET(a, b, c)                                                                            \
    "facet normal 0 0 0\nouter loop\nvertex " a "\nvertex " b "\nvertex " c "\nendloop\nendfacet" \
    "\n"
#define STL4                         \
    FACET("0 0 0", "0 1 0", "1 0 0") \
    FACET("0 0 0", "1 0 0", "0 0 1") \
    FACET("0 0 0", "0 0 1", "0 1 0") FACET("1 0 0", "0 1 0", "0 0 1")

/* Binary STL: four facets of a tetrahedron, each followed by two bytes. */
#define HEAD69         "a head of 80 bytes, which are of any kind                            "
#define HEAD75         HEAD69 "      "
#define HEAD80         HEAD75 "     "
#define ZERO           "\0\0\0\0"
#define ONE            "\0\0\x80\x3f"
#define P0             ZERO ZERO ZERO
#define PX             ONE ZERO ZERO
#define PY             ZERO ONE ZERO
#define PZ             ZERO ZERO ONE
#define BINARY(behind) P0 P0 PY PX behind P0 P0 PX PZ behind P0 P0 PZ PY behind P0 PX PY PZ behind
#define MODEL          HEAD80 "\4\0\0\0" BINARY("\0\0")

static const dialect dialects[] = {
    /* OBJ */
    { "a.obj", FILE_OF(V4 F4), 4, 4, NULL },
    { "crlf.obj", FILE_OF("v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n"), 3, 1, NULL },
    { "cr.obj", FILE_OF("v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r"), 3, 1, NULL },
    { "no_end.obj", FILE_OF("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3"), 3, 1, NULL },
    { "tabs.obj", FILE_OF("\tv\t0 0\t 0  \n v 1 0 0\t\nv  0  1  0\n\n\nf\t1 2\t3 \t\n"), 3, 1,
      NULL },
    { "mark.obj", FILE_OF("\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), 3, 1, NULL },
    { "utf16.obj", FILE_OF("\xff\xfev\0 \0"), 0, 0, "(UTF-16); save it as UTF-8" },
    { "joined.obj", FILE_OF("v 0 \\\n0 0\nv 1 0 0\nv 0 1 0\nf 1 \\\r\n 2 \\ \n3\n"), 3, 1, NULL },
    { "comments.obj", FILE_OF("# C:\\a\\\nv 0 0 0 # here\nv 1 0 0\nv 0 1 0#\nf 1 2 3 # f 1 2 3\n"),
      0, 0, "line 4: invalid number '0#'" },
    { "comment.obj", FILE_OF("# C:\\a\\\nv 0 0 0 # here\nv 1 0 0\nv 0 1 0\nf 1 2 3 # f 1 2 3\n"), 3,
      1, NULL },
    { "relative.obj", FILE_OF("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -1 -3\n"), 4, 2,
      NULL },
    { "later.obj", FILE_OF("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"), 3, 1, NULL },
    { "back.obj", FILE_OF("v 0 0 0\nf -1 -2 -3\nv 1 0 0\nv 0 1 0\n"), 0, 0,
      "line 2: a face names vertex -2, but only 1 precede it" },
    { "zero.obj", FILE_OF(V4 "f 0 1 2\n"), 0, 0, "line 5: a face names vertex 0" },
    { "beyond.obj", FILE_OF(V4 "f 1 2 5\n"), 0, 0,
      "line 5: a face names vertex 5, but there are 4 vertices" },
    { "far.obj", FILE_OF(V4 "f 1 2 99999999999999999999\n"), 0, 0, "line 5: a face names vertex" },
    { "word.obj", FILE_OF(V4 "f 1 2 three\n"), 0, 0, "line 5: invalid corner 'three'" },
    { "decimal.obj", FILE_OF(V4 "f 1 2 3.0\n"), 0, 0, "line 5: invalid corner '3.0'" },
    { "four.obj", FILE_OF(V4 "f 1/1/1/1 2 3\n"), 0, 0, "line 5: invalid corner '1/1/1/1'" },
    { "slashes.obj", FILE_OF(V4 "vt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1\nf 1/ 2// 4/1/\n"), 4, 2,
      NULL },
    { "no_vt.obj", FILE_OF(V4 "f 1/1 2/2 3/3\n"), 3, 1,
      "texture coordinates that faces refer to but the file lacks: 3" },
    { "no_vn.obj", FILE_OF(V4 "f 1//1 2//-1 3//3\n"), 3, 1,
      "normals that faces refer to but the file lacks: 3" },
    { "quad.obj", FILE_OF(V4 "f 1 2 3 4\n"), 4, 2, NULL },
    { "concave.obj", FILE_OF("v 0 0 0\nv 2 0 0\nv 0.5 0.5 0\nv 0 2 0\nf 1 2 3 4\n"), 4, 2, NULL },
    { "two.obj", FILE_OF(V4 "f 1 2\nf 1 2 3\nf 4\n"), 3, 1, NULL },
    { "old.obj", FILE_OF(V4 "fo 1 2 3\n"), 3, 1, NULL },
    { "w.obj", FILE_OF("v 0 0 0 1\nv 2 0 0 2.0\nv 0 1 0 1.0\nf 1 2 3\n"), 3, 1,
      "weights of vertices (coordinates are divided by them): 1" },
    { "w0.obj", FILE_OF("v 0 0 0 0\nv 2 0 0 2.0\nv 0 1 0 1.0\nf 1 2 3\n"), 0, 0,
      "line 1: invalid number '0' in vertex 1" },
    { "w_inf.obj", FILE_OF("v 0 0 0\nv 2 0 0 inf\nv 0 1 0\nf 1 2 3\n"), 0, 0,
      "line 2: invalid number 'inf' in vertex 2" },
    { "five.obj", FILE_OF("v 0 0 0 9 9\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), 3, 1,
      "vertex values beyond coordinates and colours: 1" },
    { "alpha.obj", FILE_OF("v 0 0 0 1 1 1 1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), 3, 1, NULL },
    { "xy.obj", FILE_OF("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n"), 0, 0,
      "line 1: vertex 1 has 2 coordinates, expected 3; add z (0 in a plane)" },
    { "comma.obj", FILE_OF("v 0,5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), 0, 0,
      "line 1: invalid number '0,5' in vertex 1" },
    { "nan.obj", FILE_OF("v nan 0 -inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), 3, 1, NULL },
    { "ind.obj", FILE_OF("v -1.#IND 1.#QNAN 1.#INF00\nv 1 nan(ind) -nan(snan)\nv 0 1 0\nf 1 2 3\n"),
      3, 1, NULL },
    { "ind_0.obj", FILE_OF("v -1.#INDEX 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), 0, 0,
      "line 1: invalid number '-1.#INDEX' in vertex 1" },
    { "sign.obj", FILE_OF("v 3.1+e2 0 0\nv 310 0 0\nv 31-E-1 1 0\nv 0 1 0\nf 1 3 4\n"), 0, 0,
      "line 3: invalid number '31-E-1' in vertex 3" },
    { "signs.obj", FILE_OF("v 3.1+e2 0 0\nv 310 0 0\nv 3100-E1 1 0\nv 0 1 0\nf 1 3 4\nf 2 4 3\n"),
      3, 2, NULL },
    { "vn_ind.obj", FILE_OF(V4 "vn -nan(ind) 0 0\nvn 0\nf 1//1 2//1 3//2\n"), 3, 1, NULL },
    { "lfs.obj", FILE_OF(LFS), 0, 0,
      "is a Git LFS pointer, not the file itself; fetch the file: git" },
    { "utf16_no_mark.obj", FILE_OF("v\0 \0001\0 \0002\0 \0003\0\n\0v\0"), 0, 0,
      "(UTF-16); save it" },
    { "utf16_be.obj", FILE_OF("\0v\0 \0001\0 \0002\0 \0003\0\n\0v"), 0, 0, "(UTF-16); save it" },
    { "gzip.obj", FILE_OF("\x1f\x8b\10\0\0"), 0, 0,
      "is compressed by gzip; decompress it: gunzip <FILE >NEW" },
    { "names.obj",
      FILE_OF("mtllib gone.mtl \xc3\xa9.mtl\ng \xe4\xb8\x89\xe8\xa7\x92 \\\no \nusemtl\n" V4 F4), 4,
      4, NULL },
    { "name_ends.obj",
      FILE_OF("g a\\\nv 9 9 9\no b\\\nusemtl c\\\nv 0 0 0\nmtllib d\\\nv 1 0 0\n"
              "s e\\\nv 0 1 0\nv 0 0 1\nf 2 4 3\nf 2 3 5\nf 2 5 4\nf 3 4 5\n"),
      4, 4, NULL },
    { "one_line_more.obj", FILE_OF("s off\ns 1\ng a b c\n" V4 "l 1 2\np 1 2 3\n" F4), 4, 4,
      "points, lines, curves and surfaces, which are not faces: 2" },
    { "curves.obj", FILE_OF(V4 "vp 1 2\ncstype bezier\ndeg 3\ncurv 0 1 1 2 3 4\nend\n"), 0, 0,
      "has no faces" },
    { "unknown.obj", FILE_OF(V4 F4 "made by hand\n\x01\x02\n"), 4, 4,
      "unknown statements: 2, the first in line 9" },
    { "same.obj", FILE_OF("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv 0 0 1\nf 1 2 3\nf 4 3 5\n"), 4, 2,
      NULL },
    { "unused.obj", FILE_OF("v 9 9 9\n" V4 "f -1 -2 -3\n"), 3, 1, NULL },
    { "empty.obj", FILE_OF(""), 0, 0, "has no faces" },
    { "points.obj", FILE_OF(V4), 0, 0, "has no faces" },
    { "pairs.obj", FILE_OF(V4 "f 1 2\n"), 0, 0, "no face has three corners" },
    { "by_its_words", FILE_OF("# of a pipe\n\n" V4 F4), 4, 4, NULL },
    { "by_its_size", FILE_OF(HEAD80 "\4\0\0\0" BINARY("\3\0abc")), 4, 4,
      "bytes after facets (attribute byte counts): 12" },
    { "html", FILE_OF("\n <!DOCTYPE html>\n<html>"), 0, 0, "is an HTML page" },
    { "zip", FILE_OF("PK\3\4"), 0, 0, "is a ZIP archive, as 3MF and NPZ files are" },
    { "xml", FILE_OF("<?xml version='1.0'?>"), 0, 0, "is an XML file" },
    { "by_no_words", FILE_OF("version 1\n"), 0, 0, "expected PLY, OBJ, STL or OFF" },
    /* OFF */
    { "a.off", FILE_OF("OFF\n4 4 6\n" OFF4 OFFF), 4, 4, NULL },
    { "counts.off", FILE_OF("OFF 4 4 6\n" OFF4 OFFF), 4, 4, NULL },
    { "glued.off", FILE_OF("OFF4 4 6\n" OFF4 OFFF), 4, 4, NULL },
    { "glued_alone.off", FILE_OF("OFF4\n4\n6\n" OFF4 OFFF), 4, 4, NULL },
    { "glued_by_its_bytes", FILE_OF("OFF4 4 6\n" OFF4 OFFF), 4, 4, NULL },
    { "glued_word.off", FILE_OF("OFF4x 4 6\n" OFF4 OFFF), 0, 0, "expected the word OFF or counts" },
    { "whitespace.off", FILE_OF("\t\t    \n  \f OFF4 4\v12 # or nah\n" OFF4 OFFF), 4, 4, NULL },
    { "white.off",
      FILE_OF("\f\n\r\n OFF\t4\f4\v6\t\n\t0\t0\v0\r\r\n1 0  0\f\r0 1 0\n\f\n 0 0 1 \n" OFFF "\f\n"),
      4, 4, NULL },
    { "mark", FILE_OF("\xef\xbb\xbfOFF\n4 4 6\n" OFF4 OFFF), 4, 4, NULL },
    { "hash.off", FILE_OF("OFF\n3 1 0\n0 0 0#a\n1. 0 0.#IND\n0 1 0\n3 0 1 2\n"), 3, 1, NULL },
    { "ind.off", FILE_OF("OFF\n4 1 0\n0 0 0\n1 0 0\n0 1 0\n1.#IND 0 0\n3 0 1 3\n"), 3, 1, NULL },
    { "not_a_number.off", FILE_OF("OFF\n3 1 0\n0 0 0\n1 0,5 0\n0 1 0\n3 0 1 2\n"), 0, 0,
      "line 4: invalid number '0,5' in vertex 1" },
    { "obj.off", FILE_OF("# a cube\n" V4 F4), 0, 0,
      "begins like an OBJ file, but its name indicates OFF; rename it to end in .obj" },
    { "lines.off", FILE_OF("OFF\n4\n4\n6\n" OFF4 OFFF), 4, 4, NULL },
    { "no_edges.off", FILE_OF("OFF\n4 4\n" OFF4 OFFF), 4, 4, NULL },
    { "no_word.off", FILE_OF("4 4 0\n" OFF4 OFFF), 4, 4, NULL },
    { "crlf.off", FILE_OF("OFF\r\n3 1 0\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n3 0 1 2\r\n"), 3, 1, NULL },
    { "cr.off", FILE_OF("OFF\r3 1 0\r0 0 0\r1 0 0\r0 1 0\r3 0 1 2\r"), 3, 1, NULL },
    { "comments.off", FILE_OF("# a\nOFF # b\n\n# c\n4 4 6 # d\n" OFF4 "# e\n" OFFF "# f"), 4, 4,
      NULL },
    { "one_line.off", FILE_OF("OFF 3 1 0 0 0 0 1 0 0 0 1 0 3 0 1 2"), 3, 1, NULL },
    { "split.off",
      FILE_OF("OFF\n4 4 0\n0\n0 0\n1 0 0\n0 1 0\n0 0 1\n3 0\n 2 1\n3\n0\n1\n3\n3 0 3 "
              "2\n3 1 2 3\n"),
      4, 4, NULL },
    { "blank.off", FILE_OF("OFF\n\n4 4 0\n\n0 0 0 \n1 0 0\t\n\n0 1 0\n0 0 1\n\n" OFFF "\n\n"), 4, 4,
      NULL },
    { "vertices.coff",
      FILE_OF("COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 "
              "255\n3 0 1 2\n"),
      3, 1, NULL },
    { "floats.off", FILE_OF("COFF\n3 1 0\n0 0 0 1 0 0\n1 0 0 0 .5 0\n0 1 0 0 0 1\n3 0 1 2\n"), 3, 1,
      NULL },
    { "normals.off", FILE_OF("NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n"), 3, 1,
      NULL },
    { "st.off", FILE_OF("STOFF\n3 1 0\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"), 3, 1, NULL },
    { "w_nan.off", FILE_OF("4OFF\n3 1 0\n0 0 0 1\n2 0 0 nan\n0 1 0 1\n3 0 1 2\n"), 0, 0,
      "line 4: invalid number 'nan' in vertex 1" },
    { "four.off", FILE_OF("4OFF\n3 1 0\n0 0 0 1\n2 0 0 2\n0 1 0 1\n3 0 1 2\n"), 3, 1,
      "weights of vertices" },
    { "n.off", FILE_OF("nOFF\n5\n3 1 0\n"), 0, 0, "the word nOFF declares" },
    { "binary.off", FILE_OF("OFF BINARY\n\0\0\0\3"), 0, 0,
      "is a binary OFF file; save it as text" },
    { "faces.off", FILE_OF("OFF\n4 2 0\n" OFF4 "3 0 2 1 255 0 0\n3 0 1 3 0.5 0 0 1\n"), 4, 2,
      NULL },
    { "table.off", FILE_OF("OFF\n4 2 0\n" OFF4 "3 0 2 1 7\n3 0 1 3\n"), 4, 2, NULL },
    { "odd.off", FILE_OF("OFF\n3 1 0\n0 0 0 9\n1 0 0 9\n0 1 0 9\n3 0 1 2 8 8\n"), 3, 1,
      "vertex values that the file's first word does not declare: 3; face values that are not "
      "colours: 1" },
    { "polygon.off", FILE_OF("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"), 4, 2, NULL },
    { "long.off", FILE_OF("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n10 0 1 2 0 1 2 0 1 2 0\n"), 3, 8,
      NULL },
    { "more.off", FILE_OF("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2\n"), 3, 1,
      "text after the last face" },
    { "too_many.off", FILE_OF("OFF 3 1 0 0 0 0 1 0 0 0 1 0 3 0 1 2 3 0 1 2"), 0, 0,
      "there is text after the last face" },
    { "fewer.off", FILE_OF("OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n"), 0, 0,
      "line 4: vertex 1 has fewer than three coordinates" },
    { "short.off", FILE_OF("OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), 0, 0,
      "the file ends before face 1" },
    { "beyond.off", FILE_OF("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), 0, 0,
      "line 6: face 0 names vertex 3, but there are 3 vertices" },
    { "minus.off", FILE_OF("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), 0, 0,
      "line 6: face 0 names fewer than its 3 vertices" },
    { "huge.off", FILE_OF("OFF\n4000000000 1 0\n0 0 0\n"), 0, 0,
      "do not fit into a file of 25 bytes" },
    { "not.off", FILE_OF("hello\n"), 0, 0, "expected the word OFF or counts" },
    /* STL */
    { "a.stl", FILE_OF("solid a\n" STL4 "endsolid a\n"), 4, 4, NULL },
    { "crlf.stl",
      FILE_OF("solid\r\nfacet normal 0 0 0\r\nouter loop\r\nvertex 0 0 0\r\nvertex 1 0 "
              "0\r\nvertex 0 1 0\r\nendloop\r\nendfacet\r\nendsolid\r\n"),
      3, 1, NULL },
    { "name.stl", FILE_OF("solid a facet of \xc3\xa9 solid outer loop\n" STL4 "endsolid"), 4, 4,
      NULL },
    { "case.stl",
      FILE_OF("SOLID A\nFACET NORMAL 0 0 0\nOUTER LOOP\nVERTEX 0 0 0\nVertex 1 0 "
              "0\nVERTEX 0 1 0\nENDLOOP\nENDFACET\nENDSOLID\n"),
      3, 1, NULL },
    { "spaces.stl",
      FILE_OF("  solid  a \n\n\tfacet  normal nan nan nan outer loop vertex 0 0 0 "
              "vertex 1e0 0 0\tvertex\n0\n1 0 endloop endfacet endsolid"),
      3, 1, NULL },
    { "no_normal.stl",
      FILE_OF("solid a\nfacet normal\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex "
              "0 1 0\nendloop\nendfacet\nendsolid a\n"),
      3, 1, NULL },
    { "two.stl",
      FILE_OF("solid a\n" STL4
              "endsolid a\nsolid b\n" FACET("5 0 0", "6 0 0", "5 1 0") "endsolid b\n"),
      7, 5, NULL },
    { "unended.stl", FILE_OF("solid a\n" STL4), 4, 4, NULL },
    { "cut.stl", FILE_OF("solid a\n" STL4 "facet normal 0 0 0\nouter loop\nvertex 0 0"), 0, 0,
      "the file ends within facet 5; it is cut short" },
    { "mark.stl", FILE_OF("\xef\xbb\xbfsolid a\n" STL4 "endsolid a\n"), 4, 4, NULL },
    { "marked_stl", FILE_OF("\xef\xbb\xbfsolid a\n" STL4 "endsolid a\n"), 4, 4, NULL },
    { "keyword.stl",
      FILE_OF("solid facet normal of facet\n" STL4 "endsolid facet normal of facet\n"), 4, 4,
      NULL },
    { "keywords.stl",
      FILE_OF("solid facet normal 0 0 0\n" STL4
              "endsolid solid\nsolid endsolid facet outer loop\n" FACET(
                  "5 0 0", "6 0 0", "5 1 0") "endsolid endsolid outer\n"),
      7, 5, NULL },
    { "facet.stl", FILE_OF("solid facet\n" STL4 "endsolid facet\n"), 4, 4, NULL },
    { "one_line.stl",
      FILE_OF(
          "solid a facet normal 0 0 0 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop "
          "endfacet endsolid a solid b facet outer loop vertex 5 0 0 vertex 6 0 0 vertex 5 1 0 "
          "endloop endfacet endsolid b"),
      6, 2, NULL },
    { "behind.stl",
      FILE_OF("solid a\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
              "endloop of 1\nendfacet 1 red\ncolor 1 0 0\nendsolid a\n"),
      3, 1, "unknown words: 7, the first in line 7" },
    { "between.stl",
      FILE_OF(
          "solid a\nmade by hand\nfacet normal 0 0 0 1 2\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
          "vertex 0 1 0\nendloop\nendfacet\nendsolid a\nvertex\n"),
      3, 1, "unknown words: 6, the first in line 2" },
    { "ind.stl",
      FILE_OF(
          "solid a\nfacet normal -1.#IND -1.#IND -1.#IND\nouter loop\nvertex 3.1+e2 0 0\nvertex "
          "1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"),
      3, 1, NULL },
    { "binary.stl", FILE_OF(MODEL), 4, 4, NULL },
    { "two_binary.stl", FILE_OF(MODEL MODEL), 4, 8, NULL },
    { "payload.stl", FILE_OF(HEAD80 "\4\0\0\0" BINARY("\4\0abcd")), 4, 4,
      "bytes after facets (attribute byte counts): 16" },
    { "solid_payload.stl", FILE_OF("solid" HEAD75 "\4\0\0\0" BINARY("\4\0abcd")), 4, 4,
      "bytes after facets (attribute byte counts): 16" },
    { "some_payload.stl",
      FILE_OF(HEAD80 "\4\0\0\0" P0 P0 PY PX "\1\0a" P0 P0 PX PZ "\0\0" P0 P0 PZ PY
                     "\2\0ab" P0 PX PY PZ "\0\0"),
      4, 4, "bytes after facets (attribute byte counts): 3" },
    { "less_payload.stl", FILE_OF(HEAD80 "\4\0\0\0" BINARY("\2\0ab") "c"), 0, 0,
      "states 4 faces, which take 284 of its 293 bytes" },
    { "spare.stl", FILE_OF(MODEL "0123456789abc"), 4, 4, "bytes after the last facet: 13" },
    { "solid_spare.stl", FILE_OF("solid facet" HEAD69 "\4\0\0\0" BINARY("\0\0") "?"), 4, 4,
      "bytes after the last facet: 1" },
    { "colours_and_spare.stl", FILE_OF(HEAD80 "\4\0\0\0" BINARY("\xff\xff") "\n"), 4, 4,
      "bytes after the last facet: 1" },
    { "count_zero.stl", FILE_OF(HEAD80 ZERO BINARY("\0\0")), 0, 0,
      "states 0 faces, but its 284 bytes hold 4; correct the count (bytes 80 to 83)" },
    { "count_two.stl", FILE_OF(HEAD80 "\2\0\0\0" BINARY("\0\0")), 0, 0,
      "states 2 faces, but its 284 bytes hold 4; correct the count" },
    { "count_most.stl", FILE_OF(HEAD80 "\xff\xff\xff\xff" BINARY("\0\0")), 0, 0,
      "states 4294967295 faces, but its 284 bytes hold 4" },
    { "no_faces.stl", FILE_OF(HEAD80 ZERO), 0, 0, "has no faces" },
    { "no_faces_spare.stl", FILE_OF(HEAD80 ZERO "abc"), 0, 0, "has no faces" },
    { "models_or_payload.stl",
      FILE_OF(HEAD80 "\1\0\0\0" P0 P0 PX PY "\206\0" HEAD80 "\1\0\0\0" P0 P0 PX PY "\0\0"), 0, 0,
      "states 1 faces, which take 134 of its 268 bytes" },
    { "obj.stl", FILE_OF(V4 F4), 0, 0,
      "begins like an OBJ file, but its name indicates STL; rename it to end in .obj" },
    { "lfs.stl", FILE_OF(LFS), 0, 0, "is a Git LFS pointer" },
    { "utf16.stl", FILE_OF("\xff\xfes\0o\0l\0i\0d\0"), 0, 0, "(UTF-16); save it as UTF-8" },
    { "utf32.stl", FILE_OF("\xff\xfe\0\0s\0\0\0"), 0, 0, "(UTF-32); save it as UTF-8" },
    { "gzip.stl", FILE_OF("\x1f\x8b\10\0" HEAD80 HEAD80), 0, 0, "is compressed by gzip" },
    { "html.stl", FILE_OF("<html><head><title>404" HEAD80), 0, 0, "is an HTML page" },
    { "comment.stl", FILE_OF("# made by x\nsolid x\n" STL4 "endsolid\n"), 0, 0,
      "is not an STL file: it is text that begins with '#'; an STL text file begins with the word "
      "solid" },
    { "quad.stl",
      FILE_OF("solid a\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex "
              "1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"),
      0, 0, "facet 1 has 4 vertices, expected 3" },
    { "comma.stl", FILE_OF("solid a\n" FACET("0 0 0", "1,5 0 0", "0 1 0") "endsolid\n"), 0, 0,
      "line 5: '1,5' instead of a coordinate, in facet 1" },
    { "word.stl", FILE_OF("solid a\n" STL4 "nonsense\nendsolid\n"), 0, 0,
      "line 30: 'nonsense' instead of facet or endsolid" },
    { "empty.stl", FILE_OF("solid a\nendsolid a\n"), 0, 0, "has no faces" },
    { "solid.stl", FILE_OF(" solid"), 0, 0, "has no faces" },
    { "not.stl", FILE_OF("not an stl file at all"), 0, 0, "is not an STL file" },
    /* PLY in text */
    { "a.ply", FILE_OF(PLY4 OFF4 OFFF), 4, 4, NULL },
    { "mark.ply", FILE_OF("\xef\xbb\xbf" PLY4 OFF4 OFFF), 4, 4, NULL },
    { "marked_ply", FILE_OF("\xef\xbb\xbf" PLY4 OFF4 OFFF), 4, 4, NULL },
    { "blank.ply", FILE_OF("ply \t\r\n" HEAD4 OFF4 OFFF), 4, 4, NULL },
    { "word.ply", FILE_OF("ply x\n" HEAD4 OFF4 OFFF), 0, 0, "it does not begin with a line 'ply'" },
    { "lfs.ply", FILE_OF(LFS), 0, 0, "is a Git LFS pointer" },
    { "float_count.ply",
      FILE_OF("ply\nformat ascii 1.0\nelement face 4\nproperty list float int vertex_indices\n"), 0,
      0, "line 4: invalid type for a list length: 'float'" },
    { "ind.ply", FILE_OF(PLY4 "3.1+e2 0 0\n1 0 1.#INF\n0 1 0\n0 0 -1.#IND\n" OFFF), 4, 4, NULL },
    { "unused.ply", FILE_OF(PLY5 OFF4 "nan 0 0\n" OFFF), 4, 4,
      "vertices with non-finite coordinates that no face uses: 1" },
    { "unused_first.ply", FILE_OF(PLY5 "0 0 -inf\n" OFF4 "3 1 3 2\n3 1 2 4\n3 1 4 3\n3 2 3 4\n"), 4,
      4, "vertices with non-finite coordinates that no face uses: 1" },
    { "follows.ply", FILE_OF(PLY4 OFF4 OFFF "\n 3 0 1 2\n"), 4, 4,
      "text after the last element, from line 19 on" },
    { "unused_finite.ply", FILE_OF(PLY5 OFF4 "9 9 9\n" OFFF), 5, 4, NULL },
    { "more.ply",
      FILE_OF(PLY4 "0 0 0 9\n1 0 0 9 \n0 1 0 9\n0 0 1 9\n3 0 2 1 8 8\n3 0 1 3\n3 0 3 2\n3 "
                   "1 2 3\n"),
      4, 4, "values that the header does not describe: 6, at the ends of 5 rows" },
    { "fewer.ply", FILE_OF(PLY4 "0 0 0\n1 0\n0 1 0\n0 0 1\n" OFFF), 0, 0,
      "line 12: vertex 1 began in line 11 and ends within this line" },
    { "joined.ply",
      FILE_OF(PLY4 "0\n0 0\n1 0 0\n0 1 0\n0 0 1\n3 0\n2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"), 4, 4,
      NULL },
};

START_TEST(test_ply_dialects_are_read_or_refused)
{
    const dialect *d = &dialects[_i];
    const char *path = scratch(d->name);
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    FILE *file = fopen(path, "wb");
    ck_assert(file && fwrite(d->text, 1, d->bytes, file) == d->bytes && fclose(file) == 0);
    for (uint64_t attributes = 0; attributes < 2; attributes++) {
        ebpo_mesh_read_options how = EBPO_MESH_READ_OPTIONS_INIT;
        how.attributes = attributes;
        ebpo_status status = ebpo_mesh_read(path, &how, &mesh, &error);
        if (!d->faces) {
            ck_assert_msg(status != EBPO_OK, "%s was read", d->name);
            ck_assert_msg(strstr(error.message, d->words), "%s", error.message);
            continue;
        }
        const char *unread = ebpo_mesh_ignored(&mesh);
        ck_assert_msg(status == EBPO_OK, "%s", error.message);
        ck_assert_msg(mesh.vertex_count == d->vertices && mesh.face_count == d->faces,
                      "%s: %d vertices, %d faces", d->name, (int)mesh.vertex_count,
                      (int)mesh.face_count);
        bool reported = !unread == !d->words && (!unread || strstr(unread, d->words));
        ck_assert_msg(reported, "%s: '%s'", d->name, unread ? unread : "no warning");
        ebpo_mesh_free(&mesh);
    }
    remove(path);
}
END_TEST

/* Files with one changed byte, and truncated files, give an error or a complete mesh.
 * EBPO_TEST_SCALE below 1: a quarter of the places. */
START_TEST(test_damaged_ply_dialects)
{
    const dialect *d = &dialects[_i];
    const char *path = scratch(d->name);
    char text[2048];
    ck_assert(d->bytes <= sizeof text);
    const size_t places = ebpo_test_scale() < 1 ? 10 : 40;
    for (size_t i = 0; i < 2 * d->bytes; i += 1 + d->bytes / places) {
        ebpo_mesh_read_options how = EBPO_MESH_READ_OPTIONS_INIT;
        ebpo_mesh mesh;
        how.attributes = 1;
        size_t n = i < d->bytes ? d->bytes : i - d->bytes;
        memcpy(text, d->text, d->bytes);
        if (i < d->bytes)
            text[i] = "\n 9/-\\\0#"[i % 8];
        remove(path); /* some file systems write data to the disk when a file is overwritten */
        FILE *file = fopen(path, "wb");
        ck_assert(file && fwrite(text, 1, n, file) == n && fclose(file) == 0);
        if (ebpo_mesh_read(path, &how, &mesh, NULL) != EBPO_OK)
            continue;
        ck_assert(mesh.face_count > 0);
        for (uint64_t k = 0; k < 3 * mesh.face_count; k++)
            ck_assert(mesh.faces[k] < mesh.vertex_count);
        ebpo_mesh_free(&mesh);
    }
    remove(path);
}
END_TEST

TEST_SUITE(dialects)
{
    TCase *tests = tcase_create("dialects");
    tcase_set_timeout(tests, 60);
    tcase_add_loop_test(tests, test_ply_dialects_are_read_or_refused, 0,
                        (int)(sizeof dialects / sizeof *dialects));
    tcase_add_loop_test(tests, test_damaged_ply_dialects, 0,
                        (int)(sizeof dialects / sizeof *dialects));
    Suite *suite = suite_create("dialects");
    suite_add_tcase(suite, tests);
    return suite;
}
