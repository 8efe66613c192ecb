/* Run exported code on another processor: run_code IMAGE ACTIONS.
   facts.h is written from the description. Prints all states and rewards, as bytes. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef int32_t function(void *table, int64_t length, int64_t worlds);
typedef struct { function *f; int64_t table, length; } call;
typedef struct { int64_t offset, bytes; } array;
#include "facts.h"

static char *read_file(const char *path, size_t *size) {
  FILE *file = fopen(path, "rb");
  if (!file) exit(2);
  fseek(file, 0, SEEK_END);
  *size = ftell(file);
  rewind(file);
  char *data = aligned_alloc(64, (*size + 64) / 64 * 64);
  if (fread(data, 1, *size, file) != *size) exit(2);
  fclose(file);
  return data;
}

int main(int count, char **words) {
  size_t size, given;
  char *image = read_file(words[1], &size), *actions = read_file(words[2], &given);
  for (size_t k = 0; k < sizeof OFFSETS / sizeof *OFFSETS; k++) {
    int64_t word;
    memcpy(&word, image + OFFSETS[k], 8);
    word += (int64_t)(intptr_t)image;
    memcpy(image + OFFSETS[k], &word, 8);
  }
  for (size_t k = 0; (k + 1) * ACTION.bytes <= given; k++) {
    memcpy(image + ACTION.offset, actions + k * ACTION.bytes, ACTION.bytes);
    const call *calls = k % 2 ? STEP_1 : STEP_0;
    for (int i = 0; i < CALLS; i++)
      if (calls[i].f(image + calls[i].table, calls[i].length, 1) != 1) return 1;
    const array *shown = k % 2 ? SHOWN_0 : SHOWN_1;
    for (int i = 0; i < SHOWN; i++) fwrite(image + shown[i].offset, 1, shown[i].bytes, stdout);
  }
  return 0;
}
