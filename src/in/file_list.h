// SPDX-License-Identifier: Apache-2.0
// ParaView's lists of files in the order of time: .pvd (XML) and .series (JSON).
#pragma once

#include "riffle/base.h"

typedef struct RfFileList
{
    /// Relative names are taken from the list's folder.
    char **paths;
    int count;
} RfFileList;

/// By the extension.
bool rf_file_list_is(const char *path);

/// Refuses an empty list and more than a million files. The times in it are not looked at: the order counts.
RfResult rf_file_list_parse(const char *path, const uint8_t *bytes, size_t size, RfFileList *out);
RfResult rf_file_list_read(const char *path, RfFileList *out);
void rf_file_list_free(RfFileList *list);
