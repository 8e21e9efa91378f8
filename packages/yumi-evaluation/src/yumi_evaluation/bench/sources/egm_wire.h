/* Protobuf by hand, as far as EGM needs it: writing the robot's datagram, reading the reply's doubles. */
#pragma once
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { LARGEST = 1024 };

/* ---- writing ---- */

typedef struct { uint8_t bytes[LARGEST]; size_t size; } Message;

static void put_varint(Message *m, uint64_t value)
{
    for (; value > 0x7f; value >>= 7) m->bytes[m->size++] = (uint8_t)(value & 0x7f) | 0x80;
    m->bytes[m->size++] = (uint8_t)value;
}

static void put_number(Message *m, unsigned field, uint64_t value) { put_varint(m, field << 3); put_varint(m, value); }

static void put_double(Message *m, unsigned field, double value)
{
    put_varint(m, field << 3 | 1);
    memcpy(m->bytes + m->size, &value, sizeof value);
    m->size += sizeof value;
}

static void put_message(Message *m, unsigned field, const Message *part)
{
    put_varint(m, field << 3 | 2);
    put_varint(m, part->size);
    memcpy(m->bytes + m->size, part->bytes, part->size);
    m->size += part->size;
}

static void put_doubles(Message *m, unsigned field, const double *values, int count)
{
    Message part = {.size = 0};
    for (int i = 0; i < count; ++i) put_double(&part, 1, values[i]);
    put_message(m, field, &part);
}

static void put_state(Message *m, unsigned field, uint64_t value)
{
    Message part = {.size = 0};
    put_number(&part, 1, value);
    put_message(m, field, &part);
}

static void put_triple(Message *m, unsigned field, double x, double y, double z)
{
    Message part = {.size = 0};
    put_double(&part, 1, x), put_double(&part, 2, y), put_double(&part, 3, z);
    put_message(m, field, &part);
}

/* ---- reading ---- */

typedef struct { const uint8_t *at, *end; } Reader;

static int take_varint(Reader *r, uint64_t *value)
{
    *value = 0;
    for (int shift = 0; shift < 64 && r->at < r->end; shift += 7) {
        uint8_t byte = *r->at++;
        *value |= (uint64_t)(byte & 0x7f) << shift;
        if (byte < 0x80) return 1;
    }
    return 0;
}

/* The next field: its number and wire type in *tag, its content in *part (empty for a varint); 0 at the end. */
static int take_field(Reader *r, uint64_t *tag, Reader *part)
{
    uint64_t size;
    if (r->at >= r->end || !take_varint(r, tag)) return 0;
    switch (*tag & 7) {
    case 0: *part = (Reader){r->end, r->end}; return take_varint(r, &size);
    case 1: size = 8; break;
    case 2: if (!take_varint(r, &size)) return 0; break;
    case 5: size = 4; break;
    default: return 0;
    }
    if ((uint64_t)(r->end - r->at) < size) return 0;
    *part = (Reader){r->at, r->at + size};
    r->at += size;
    return 1;
}

static int find_message(Reader r, unsigned field, Reader *part)
{
    uint64_t tag;
    while (take_field(&r, &tag, part)) if (tag == (field << 3 | 2)) return 1;
    return 0;
}

static int take_doubles(Reader r, double *values, int most) /* packed or not */
{
    uint64_t tag;
    Reader part;
    int count = 0;
    while (take_field(&r, &tag, &part))
        for (; tag >> 3 == 1 && part.end - part.at >= 8 && count < most; part.at += 8) memcpy(&values[count++], part.at, 8);
    return count;
}
