/* Defines functions that replace the encoders of zstd and zlib. The table of codecs refers to the
 * encoders, but the module writes no files, so nothing calls them. */
#define ZSTD_STATIC_LINKING_ONLY
#include <zlib.h>
#include <zstd.h>

ZSTD_CCtx *ZSTD_createCCtx(void) { return NULL; }

size_t ZSTD_freeCCtx(ZSTD_CCtx *context)
{
    (void)context;
    return 0;
}

size_t ZSTD_CCtx_reset(ZSTD_CCtx *context, ZSTD_ResetDirective reset)
{
    (void)context, (void)reset;
    return (size_t)-1;
}

size_t ZSTD_CCtx_setParameter(ZSTD_CCtx *context, ZSTD_cParameter parameter, int value)
{
    (void)context, (void)parameter, (void)value;
    return (size_t)-1;
}

size_t ZSTD_CCtx_setPledgedSrcSize(ZSTD_CCtx *context, unsigned long long size)
{
    (void)context, (void)size;
    return (size_t)-1;
}

size_t ZSTD_compress2(ZSTD_CCtx *context, void *out, size_t capacity, const void *in, size_t size)
{
    (void)context, (void)out, (void)capacity, (void)in, (void)size;
    return (size_t)-1;
}

size_t ZSTD_compressStream2(ZSTD_CCtx *context, ZSTD_outBuffer *out, ZSTD_inBuffer *in,
                            ZSTD_EndDirective end)
{
    (void)context, (void)out, (void)in, (void)end;
    return (size_t)-1;
}

int compress2(Bytef *out, uLongf *capacity, const Bytef *in, uLong size, int level)
{
    (void)out, (void)capacity, (void)in, (void)size, (void)level;
    return Z_MEM_ERROR;
}
