// SPDX-License-Identifier: Apache-2.0
#include "out/image.h"

#include "core/result.h"

#include <string.h>
#include <strings.h>

static const RfImageWriter *const g_writers[] = {&rf_png_writer, &rf_exr_writer, &rf_npy_writer};

static const RfImageWriter *writer_for(const char *path)
{
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash : path, '.');
    for (size_t i = 0; dot && i < sizeof g_writers / sizeof g_writers[0]; ++i)
    {
        if (strcasecmp(dot + 1, g_writers[i]->extension) == 0)
            return g_writers[i];
    }
    return NULL;
}

RfResult rf_image_write(const char *path, const RfImage *image)
{
    RF_REQUIRE(path && image, "rf_image_write: NULL argument");
    const RfImageWriter *writer = writer_for(path);
    if (!writer)
        return rf_fail(RF_UNSUPPORTED, path, NULL, "images are written as .png, .exr or .npy; name it so");
    RfOutFile file;
    RF_TRY(rf_out_open(path, &file));
    RfResult result = writer->encode(&file, image);
    RfResult closed = rf_out_close(&file, result == RF_OK);
    return result != RF_OK ? result : closed;
}
