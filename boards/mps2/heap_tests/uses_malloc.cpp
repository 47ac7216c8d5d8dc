// Wants a heap: an image with this source must not link.
#include <cstdlib>

void* volatile block = std::malloc(16);
