// SPDX-License-Identifier: Apache-2.0
#include "core/saved_state.h"
#include "core/hash.h"
#include "core/result.h"
#include "core/simd.h"

#include <string.h>

static uint64_t content_hash(RfStateHead head, const void *block, size_t size)
{
    head.content = 0;
    return rf_hash_bytes((const uint8_t *)block + sizeof head, size - sizeof head,
                         rf_hash_bytes(&head, sizeof head, 0));
}

static RfStateHead head_of(const char *method, uint32_t version, uint64_t inputs)
{
    RfStateHead head = {.version = version, .simd = (uint32_t)rf_simd_level(), .inputs = inputs};
    assert(strlen(method) <= sizeof head.method);
    memcpy(head.method, method, strlen(method));
    return head;
}

void rf_state_seal(void *block, size_t size, const char *method, uint32_t version, uint64_t inputs)
{
    RfStateHead head = head_of(method, version, inputs);
    head.content = content_hash(head, block, size);
    memcpy(block, &head, sizeof head);
}

RfResult rf_state_damaged(void)
{
    return rf_fail(RF_BAD_INPUT, NULL, "saved state", "damaged: start again");
}

RfResult rf_state_check(const void *block, size_t size, size_t header_size, const char *method, uint32_t version,
                        uint64_t inputs)
{
    RfStateHead head, wanted = head_of(method, version, inputs);
    if (size < header_size)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "a saved state is at least %zu bytes, this is %zu", header_size,
                       size);
    memcpy(&head, block, sizeof head);
    if (memcmp(head.method, wanted.method, sizeof head.method) != 0)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "not a saved state of %s", method);
    if (head.version != version)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved by version %u of the format, this is %u: start again",
                       head.version, version);
    if (head.simd != wanted.simd)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved under another instruction set: set RF_SIMD as it was");
    if (head.inputs != inputs)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved with another exemplar or other options: start again");
    return head.content == content_hash(head, block, size) ? RF_OK : rf_state_damaged();
}
