/* Files that are damaged: bytes changed, left out, repeated, and cut, at random, half of them with a checksum that is right again.
 *
 *     damaged COUNT FILE...
 *
 * Each is read from memory that ends where the file does, so that valgrind sees what is read beyond; sanitizers see this file alone,
 * since the library is not compiled with them. What is accepted is stepped a few times, saved and restored. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "punctual.h"

static uint64_t state = 55;

static uint64_t draw(void) {
    state += 0x9e3779b97f4a7c15;
    uint64_t z = state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
}

static uint32_t checksum(const unsigned char *bytes, size_t size) {
    uint32_t crc = 0xffffffff;
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) crc = (crc >> 1) ^ (0xedb88320 & (0 - (crc & 1)));
    }
    return ~crc;
}

static void put(unsigned char *bytes, uint32_t number) {
    for (int i = 0; i < 4; i++) bytes[i] = (unsigned char)(number >> 8 * i);
}

int main(int count, char **arguments) {
    if (count < 3) return 2;
    unsigned long long files = strtoull(arguments[1], 0, 10), seen[9] = {0}, steps = 0;
    for (unsigned long long k = 0; k < files; k++) {
        FILE *file = fopen(arguments[2 + draw() % (unsigned)(count - 2)], "rb");
        unsigned char bytes[8192];
        if (!file) return 2;
        size_t size = fread(bytes, 1, sizeof bytes / 2, file);
        fclose(file);
        for (unsigned long long changes = 1 + draw() % 4; changes; changes--) {
            size_t at = draw() % size, length = 1 + draw() % 8;
            if (at + length > size) length = size - at;
            switch (draw() % 5) {
            case 0: bytes[at] ^= (unsigned char)(1 << draw() % 8); break;
            case 1: bytes[at] = (unsigned char)draw(); break;
            case 2: memset(bytes + at, draw() % 2 ? 0xff : 0, length); break;
            case 3: memmove(bytes + at, bytes + at + length, size - at - length), size -= length; break;
            default: memmove(bytes + at + length, bytes + at, size - at), size += length; break;
            }
            if (size < 17) size = 17;
        }
        if (draw() % 8 == 0) size = 1 + draw() % size;
        if (size > 16 && draw() % 2) {
            memcpy(bytes, "PUNCTL\0\1", 8);
            put(bytes + 8, (uint32_t)(size - 16));
            put(bytes + 12, checksum(bytes + 16, size - 16));
        }
        unsigned char *own = malloc(size);
        if (!own) return 2;
        memcpy(own, bytes, size);
        size_t needed;
        enum punctual_result result = punctual_size(own, size, &needed);
        if (result == PUNCTUAL_RESULT_OK && needed < 64 * 1024 * 1024) {
            void *memory = malloc(needed);
            punctual_filter *filter;
            result = punctual_load(memory, needed, own, size, &filter);
            if (result == PUNCTUAL_RESULT_OK) {
                size_t states, inputs, barriers, written;
                punctual_dimensions(filter, &states, &inputs, &barriers);
                size_t room = punctual_saved_size(filter);
                unsigned char *saved = malloc(room);
                double x[64], u[32];
                for (int step = 0; step < 3; step++) {
                    for (size_t i = 0; i < 64; i++) x[i] = (double)(int64_t)draw() * 1e-18;
                    for (size_t i = 0; i < 32; i++) u[i] = (double)(int64_t)draw() * 1e-18;
                    if (punctual_step(filter, 0.01 * step, x, states, u, u, inputs, 0) != PUNCTUAL_RESULT_OK) return 3;
                    for (size_t i = 0; i < inputs; i++)
                        if (!isfinite(u[i])) return 4;
                    steps++;
                }
                if (punctual_save(filter, saved, room, &written) != PUNCTUAL_RESULT_OK) return 5;
                if (punctual_restore(filter, saved, written) != PUNCTUAL_RESULT_OK) return 6;
                saved[draw() % written] ^= 1;
                if (punctual_restore(filter, saved, written) == PUNCTUAL_RESULT_OK) return 7;
                free(saved);
            }
            free(memory);
        }
        seen[result]++;
        free(own);
    }
    printf("%llu files: %llu accepted and stepped %llu times, %llu no filter, %llu damaged, %llu without room, %llu out of range\n", files,
           seen[PUNCTUAL_RESULT_OK], steps, seen[PUNCTUAL_RESULT_FORMAT], seen[PUNCTUAL_RESULT_DAMAGED], seen[PUNCTUAL_RESULT_ROOM],
           seen[PUNCTUAL_RESULT_RANGE]);
    return 0;
}
