// SPDX-License-Identifier: Apache-2.0
// TEST_SANITIZED: 1 in a build with address or thread sanitizer, where everything takes ten times as long. Tests whose
// point is many repetitions make fewer there.
#pragma once

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TEST_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define TEST_SANITIZED 1
#endif
#endif
#ifndef TEST_SANITIZED
#define TEST_SANITIZED 0
#endif
