// Wants a heap: an image with this source must not link.
int* volatile block = new int[16];
