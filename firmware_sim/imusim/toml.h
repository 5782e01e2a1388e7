#pragma once

/// toml++, told to report what a careless file makes it meet. Its own assertions (3.3: '[' and a character
/// that begins no key) would end the program before the error that it has for the same place. Included here
/// and nowhere else.

#define TOML_ASSERT(expr) static_assert(true)
#include <toml++/toml.h>
