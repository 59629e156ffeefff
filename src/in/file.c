// SPDX-License-Identifier: Apache-2.0
#include "in/file.h"
#include "core/memory.h"
#include "core/progress.h"
#include "core/result.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// A tenth of a second of a slow disk.
static const size_t BYTES_A_REPORT = (size_t)16 << 20;

static RfResult read_all(int file, const char *path, RfBytes *out)
{
    size_t done = 0;
    while (done < out->size)
    {
        if (done > 0)
            RF_TRY(rf_progress("reading", (double)done / (double)out->size));
        size_t left = out->size - done;
        ssize_t got = read(file, out->data + done, left < BYTES_A_REPORT ? left : BYTES_A_REPORT);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return rf_fail(RF_UNREADABLE, path, NULL, "cannot be read: %s", strerror(errno));
        if (got == 0)
            return rf_fail(RF_UNREADABLE, path, NULL, "became shorter while it was read (%zu of %zu bytes)", done,
                           out->size);
        done += (size_t)got;
    }
    return RF_OK;
}

RfResult rf_bytes_read(const char *path, size_t limit, RfBytes *out)
{
    *out = (RfBytes){0};
    if (limit == 0)
        limit = (size_t)8 << 30;
    int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return rf_fail(RF_UNREADABLE, path, NULL, "cannot be opened: %s", strerror(errno));
    struct stat status;
    RfResult result = RF_OK;
    if (fstat(file, &status) != 0)
        result = rf_fail(RF_UNREADABLE, path, NULL, "cannot be read: %s", strerror(errno));
    else if (!S_ISREG(status.st_mode))
        result = rf_fail(RF_UNREADABLE, path, NULL, "is not a regular file");
    else if ((uint64_t)status.st_size > limit)
        result =
            rf_fail(RF_BAD_INPUT, path, NULL, "has %lld bytes: at most %zu are read", (long long)status.st_size, limit);
    if (result == RF_OK)
    {
        out->size = (size_t)status.st_size;
        out->data = rf_allocate(out->size, 1);
        result = out->data ? read_all(file, path, out) : RF_OUT_OF_MEMORY;
    }
    close(file);
    if (result != RF_OK)
        rf_bytes_free(out);
    return result;
}

void rf_bytes_free(RfBytes *bytes)
{
    rf_release(bytes->data);
    *bytes = (RfBytes){0};
}
