/* SPDX-License-Identifier: MIT
 * For builds with MemorySanitizer: reports memory written by libraries that it has not compiled, by
 * wrapping the functions that write (`-Wl,--wrap`, tests/fuzz/meson.build). Without that each byte
 * of a decompressor would count as never written. */
#include <gmp.h>
#include <jansson.h>
#include <nettle/sha2.h>
#include <sanitizer/msan_interface.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>
#include <zstd.h>

/* --- libzstd --- */

#define ZSTD_OUT(name, parameters, arguments) \
    size_t __real_##name parameters;          \
    size_t __wrap_##name parameters;          \
    size_t __wrap_##name parameters           \
    {                                         \
        size_t n = __real_##name arguments;   \
        if (!ZSTD_isError(n))                 \
            __msan_unpoison(out, n);          \
        return n;                             \
    }

ZSTD_OUT(ZSTD_decompressDCtx,
         (ZSTD_DCtx * of, void *out, size_t space, const void *in, size_t bytes),
         (of, out, space, in, bytes))
ZSTD_OUT(ZSTD_decompress, (void *out, size_t space, const void *in, size_t bytes),
         (out, space, in, bytes))
ZSTD_OUT(ZSTD_compress2, (ZSTD_CCtx * of, void *out, size_t space, const void *in, size_t bytes),
         (of, out, space, in, bytes))

size_t __real_ZSTD_compressStream2(ZSTD_CCtx *of, ZSTD_outBuffer *out, ZSTD_inBuffer *in,
                                   ZSTD_EndDirective end);
size_t __wrap_ZSTD_compressStream2(ZSTD_CCtx *of, ZSTD_outBuffer *out, ZSTD_inBuffer *in,
                                   ZSTD_EndDirective end);
size_t __wrap_ZSTD_compressStream2(ZSTD_CCtx *of, ZSTD_outBuffer *out, ZSTD_inBuffer *in,
                                   ZSTD_EndDirective end)
{
    size_t before = out->pos, left = __real_ZSTD_compressStream2(of, out, in, end);
    __msan_unpoison((char *)out->dst + before, out->pos - before);
    return left;
}

/* --- zlib --- */

int __real_uncompress2(Bytef *out, uLongf *space, const Bytef *in, uLong *bytes);
int __wrap_uncompress2(Bytef *out, uLongf *space, const Bytef *in, uLong *bytes);
int __wrap_uncompress2(Bytef *out, uLongf *space, const Bytef *in, uLong *bytes)
{
    int status = __real_uncompress2(out, space, in, bytes);
    __msan_unpoison(out, *space);
    return status;
}

int __real_compress2(Bytef *out, uLongf *space, const Bytef *in, uLong bytes, int level);
int __wrap_compress2(Bytef *out, uLongf *space, const Bytef *in, uLong bytes, int level);
int __wrap_compress2(Bytef *out, uLongf *space, const Bytef *in, uLong bytes, int level)
{
    int status = __real_compress2(out, space, in, bytes, level);
    if (status == Z_OK)
        __msan_unpoison(out, *space);
    return status;
}

/* --- nettle --- */

void __real_nettle_sha256_init(struct sha256_ctx *of);
void __wrap_nettle_sha256_init(struct sha256_ctx *of);
void __wrap_nettle_sha256_init(struct sha256_ctx *of)
{
    __msan_unpoison(of, sizeof *of);
    __real_nettle_sha256_init(of);
}

void __real_nettle_sha256_digest(struct sha256_ctx *of, size_t bytes, uint8_t *out);
void __wrap_nettle_sha256_digest(struct sha256_ctx *of, size_t bytes, uint8_t *out);
void __wrap_nettle_sha256_digest(struct sha256_ctx *of, size_t bytes, uint8_t *out)
{
    __real_nettle_sha256_digest(of, bytes, out);
    __msan_unpoison(out, bytes);
}

/* --- GMP: a number counts as written once it is initialised, and its limbs always --- */

#define GMP_INIT(type, name)                                                                 \
    void __real___gmp##name##_init(type of);                                                 \
    void __wrap___gmp##name##_init(type of);                                                 \
    void __wrap___gmp##name##_init(type of)                                                  \
    {                                                                                        \
        __msan_unpoison(of, sizeof *of);                                                     \
        __real___gmp##name##_init(of);                                                       \
    }                                                                                        \
    void __wrap___gmp##name##_inits(type first, ...);                                        \
    void __wrap___gmp##name##_inits(type first, ...)                                         \
    {                                                                                        \
        va_list more;                                                                        \
        va_start(more, first);                                                               \
        for (__typeof__(&first[0]) of = first; of; of = va_arg(more, __typeof__(&first[0]))) \
            __wrap___gmp##name##_init(of);                                                   \
        va_end(more);                                                                        \
    }

GMP_INIT(mpz_t, z)
GMP_INIT(mpq_t, q)

void __real___gmpz_init_set_ui(mpz_t of, unsigned long value);
void __wrap___gmpz_init_set_ui(mpz_t of, unsigned long value);
void __wrap___gmpz_init_set_ui(mpz_t of, unsigned long value)
{
    __msan_unpoison(of, sizeof *of);
    __real___gmpz_init_set_ui(of, value);
}

static void *zeroed(size_t bytes)
{
    void *p = calloc(1, bytes ? bytes : 1);
    if (!p)
        exit(2);
    return p;
}

static void *zeroed_again(void *old, size_t before, size_t bytes)
{
    void *p = zeroed(bytes);
    memcpy(p, old, before < bytes ? before : bytes);
    free(old);
    return p;
}

static void free_sized(void *p, size_t bytes)
{
    (void)bytes;
    free(p);
}

/* --- jansson --- */

json_t *__real_json_loadb(const char *text, size_t bytes, size_t flags, json_error_t *error);
json_t *__wrap_json_loadb(const char *text, size_t bytes, size_t flags, json_error_t *error);
json_t *__wrap_json_loadb(const char *text, size_t bytes, size_t flags, json_error_t *error)
{
    __msan_unpoison(error, sizeof *error);
    return __real_json_loadb(text, bytes, flags, error);
}

/* --- functions of this C library unknown to clang 14 --- */

#define STAT_OUT(name, first)                     \
    int __real_##name(first, struct stat *out);   \
    int __wrap_##name(first, struct stat *out);   \
    int __wrap_##name(first of, struct stat *out) \
    {                                             \
        int status = __real_##name(of, out);      \
        if (status == 0)                          \
            __msan_unpoison(out, sizeof *out);    \
        return status;                            \
    }
STAT_OUT(stat64, const char *)
STAT_OUT(fstat64, int)

__attribute__((constructor)) static void begin(void)
{
    mp_set_memory_functions(zeroed, zeroed_again, free_sized);
    json_set_alloc_funcs(zeroed, free);
}
