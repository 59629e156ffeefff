// SPDX-License-Identifier: Apache-2.0
#include "out/file.h"
#include "core/result.h"

#include <errno.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

RfResult rf_out_temporary_name(const char *path, char *name, size_t size)
{
    const char *slash = strrchr(path, '/');
    int folder = slash ? (int)(slash - path) + 1 : 0;
    const char *base = path + folder;
    int length = snprintf(name, size, "%.*s.tmp%ld.%s", folder, path, (long)getpid(), base);
    if (length < 0 || (size_t)length >= size || base[0] == '\0')
        return rf_fail(RF_WRITE_FAILED, path, NULL, "is not a usable file name");
    return RF_OK;
}

RfResult rf_out_open(const char *path, RfOutFile *out)
{
    *out = (RfOutFile){0};
    if (strlen(path) >= sizeof out->path)
        return rf_fail(RF_WRITE_FAILED, path, NULL, "the name is longer than %zu characters", sizeof out->path - 1);
    strcpy(out->path, path);
    RF_TRY(rf_out_temporary_name(path, out->temporary, sizeof out->temporary));
    out->stream = fopen(out->temporary, "wbe");
    if (!out->stream)
        return rf_fail(RF_WRITE_FAILED, path, NULL, "cannot be written: %s", strerror(errno));
    return RF_OK;
}

static RfResult write_failed(const RfOutFile *out)
{
    return rf_fail(RF_WRITE_FAILED, out->path, NULL, "cannot be written: %s", strerror(errno));
}

RfResult rf_out_write(RfOutFile *out, const void *data, size_t size)
{
    return size == 0 || fwrite(data, size, 1, out->stream) == 1 ? RF_OK : write_failed(out);
}

RfResult rf_out_close(RfOutFile *out, bool keep)
{
    if (!out->stream)
        return RF_OK;
    RfResult result = RF_OK;
    if (keep && (ferror(out->stream) || fflush(out->stream) != 0 || fsync(fileno(out->stream)) != 0))
        result = write_failed(out);
    if (fclose(out->stream) != 0 && keep && result == RF_OK)
        result = write_failed(out);
    if (keep && result == RF_OK && rename(out->temporary, out->path) != 0)
        result = write_failed(out);
    if (!keep || result != RF_OK)
        unlink(out->temporary);
    out->stream = NULL;
    return result;
}
