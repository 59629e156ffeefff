// SPDX-License-Identifier: Apache-2.0
// What all saved states begin with: whose they are, and whether they are whole.
#pragma once

#include "riffle/base.h"

/// First member of a state's header.
typedef struct RfStateHead
{
    /// Name of the method, ended or filled up with zeros.
    char method[16];
    /// Of the method's format; rf_simd_level(), since another instruction set rounds differently.
    uint32_t version, simd;
    /// Hashes of exemplar and options, and of the whole block with this field 0.
    uint64_t inputs, content;
} RfStateHead;

/// Writes the head of a block that is otherwise complete.
void rf_state_seal(void *block, size_t size, const char *method, uint32_t version, uint64_t inputs);
/// RF_BAD_INPUT for a block that rf_state_seal did not make of the same, or that has changed since. header_size: what a
/// block has at least.
RfResult rf_state_check(const void *block, size_t size, size_t header_size, const char *method, uint32_t version,
                        uint64_t inputs);
/// For what a block says that cannot be.
RfResult rf_state_damaged(void);
