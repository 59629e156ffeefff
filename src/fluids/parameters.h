// SPDX-License-Identifier: Apache-2.0
// Parameters of the built-in inputs: "name?size=512x256&speed=2" against a list of names and ranges. The text of the
// defaults is parsed by the same code as the user's, so the table that is printed is the one that is used.
#pragma once

#include "riffle/base.h"

enum
{
    RF_PARAMETER_LIMIT = 8
};

typedef enum RfParameterKind
{
    /// "256" or "512x256"; the range holds for either side.
    RF_PARAMETER_SIZE,
    RF_PARAMETER_NUMBER,
    RF_PARAMETER_INTEGER
} RfParameterKind;

typedef struct RfParameterRange
{
    /// NULL ends a list.
    const char *name;
    RfParameterKind kind;
    double minimum, maximum;
} RfParameterRange;

typedef struct RfParameters
{
    const RfParameterRange *ranges;
    double values[RF_PARAMETER_LIMIT];
    int width, height;
} RfParameters;

/// True if `spec` is `name`, with or without "?...".
bool rf_parameters_named(const char *spec, const char *name);
/// The defaults, then what stands behind the "?" of `spec`. RF_BAD_INPUT with file "builtin:SPEC" and the parameter as
/// the place.
RfResult rf_parameters_read(const char *spec, const char *defaults, const RfParameterRange *ranges, RfParameters *out);
/// The value of a parameter of the list.
double rf_parameter(const RfParameters *parameters, const char *name);
