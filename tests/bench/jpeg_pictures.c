/* Compresses pictures as JPEG, and writes the decoded pictures to standard output.
 *
 *     jpeg_pictures WIDTH HEIGHT QUALITY COUNT < RGB > RGB
 *
 * Prints the compressed bytes of all pictures, with optimized Huffman tables, on standard error. */
#include <stdio.h>
#include <stdlib.h>

#include <jpeglib.h>

static unsigned long encode(unsigned char *rgb, int width, int height, int quality,
                            unsigned char **out)
{
    struct jpeg_compress_struct j;
    struct jpeg_error_mgr errors;
    unsigned long size = 0;
    j.err = jpeg_std_error(&errors);
    jpeg_create_compress(&j);
    jpeg_mem_dest(&j, out, &size);
    j.image_width = (JDIMENSION)width;
    j.image_height = (JDIMENSION)height;
    j.input_components = 3;
    j.in_color_space = JCS_RGB;
    jpeg_set_defaults(&j);
    jpeg_set_quality(&j, quality, TRUE);
    j.optimize_coding = TRUE;
    jpeg_start_compress(&j, TRUE);
    while (j.next_scanline < j.image_height) {
        JSAMPROW row = rgb + 3 * (size_t)width * j.next_scanline;
        jpeg_write_scanlines(&j, &row, 1);
    }
    jpeg_finish_compress(&j);
    jpeg_destroy_compress(&j);
    return size;
}

static void decode(const unsigned char *bytes, unsigned long size, unsigned char *rgb)
{
    struct jpeg_decompress_struct j;
    struct jpeg_error_mgr errors;
    j.err = jpeg_std_error(&errors);
    jpeg_create_decompress(&j);
    jpeg_mem_src(&j, bytes, size);
    jpeg_read_header(&j, TRUE);
    jpeg_start_decompress(&j);
    while (j.output_scanline < j.output_height) {
        JSAMPROW row = rgb + 3 * (size_t)j.output_width * j.output_scanline;
        jpeg_read_scanlines(&j, &row, 1);
    }
    jpeg_finish_decompress(&j);
    jpeg_destroy_decompress(&j);
}

int main(int argc, char **argv)
{
    unsigned long all = 0;
    int width = argc == 5 ? atoi(argv[1]) : 0, height = argc == 5 ? atoi(argv[2]) : 0;
    if (width < 1 || height < 1 || width > 8192 || height > 8192) {
        fprintf(stderr, "usage: jpeg_pictures WIDTH HEIGHT QUALITY COUNT < RGB > RGB\n");
        return 2;
    }
    size_t bytes = 3 * (size_t)width * (size_t)height;
    unsigned char *rgb = malloc(bytes);
    for (int i = atoi(argv[4]); i > 0 && rgb; i--) {
        unsigned char *coded = NULL;
        if (fread(rgb, 1, bytes, stdin) != bytes)
            return 1;
        unsigned long size = encode(rgb, width, height, atoi(argv[3]), &coded);
        decode(coded, size, rgb);
        fwrite(rgb, 1, bytes, stdout);
        free(coded);
        all += size;
    }
    free(rgb);
    fprintf(stderr, "%lu\n", all);
    return 0;
}
