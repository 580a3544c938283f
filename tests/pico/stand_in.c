/* Stands in for zenoh-pico, and for a board: what the node does with Zenoh are lines to whoever runs this program, which has
   a session; what comes in that session are lines to it. A line is a word and arguments, bytes in hexadecimal behind a dot. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <zenoh-pico.h>

typedef struct {
    size_t size;
    uint8_t data[];
} buffer_t;

typedef struct {
    void (*call)(void *, void *);
    z_closure_drop_callback_t drop;
    void *context;
} closure_t;

struct z_loaned_sample_t {
    z_loaned_keyexpr_t key;
    z_loaned_bytes_t payload, attachment;
};

struct z_loaned_reply_t {
    z_loaned_sample_t sample;
};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static closure_t closures[1000];
static int known;

#define DEFINED(name)                                                                                    \
    const z_loaned_##name##_t *z_##name##_loan(const z_owned_##name##_t *obj) { return &obj->_val; }     \
    z_loaned_##name##_t *z_##name##_loan_mut(z_owned_##name##_t *obj) { return &obj->_val; }             \
    z_moved_##name##_t *z_##name##_move(z_owned_##name##_t *obj) { return (z_moved_##name##_t *)obj; }   \
    void z_##name##_drop(z_moved_##name##_t *obj) { (void)obj; }
DEFINED(bytes)
DEFINED(config)
DEFINED(session)
DEFINED(liveliness_token)
DEFINED(closure_sample)
DEFINED(closure_reply)

const z_loaned_string_t *z_view_string_loan(const z_view_string_t *obj) { return &obj->_val; }
const z_loaned_keyexpr_t *z_view_keyexpr_loan(const z_view_keyexpr_t *obj) { return &obj->_val; }

/* --- bytes and keys --- */

static buffer_t *buffer(size_t size)
{
    buffer_t *made = malloc(sizeof *made + size);
    made->size = size;
    return made;
}

static buffer_t *unhex(const char *digits)
{
    buffer_t *made = buffer(strlen(digits) / 2);
    size_t i;
    for (i = 0; i < made->size; i++) {
        unsigned byte;
        sscanf(digits + 2 * i, "%2x", &byte);
        made->data[i] = (uint8_t)byte;
    }
    return made;
}

z_result_t z_bytes_copy_from_buf(z_owned_bytes_t *bytes, const uint8_t *data, size_t len)
{
    buffer_t *made = buffer(len);
    memcpy(made->data, data, len);
    bytes->_val._value = made;
    return 0;
}

size_t z_bytes_len(const z_loaned_bytes_t *bytes) { return ((buffer_t *)bytes->_value)->size; }

z_bytes_reader_t z_bytes_get_reader(const z_loaned_bytes_t *bytes)
{
    z_bytes_reader_t reader = {bytes, 0};
    return reader;
}

size_t z_bytes_reader_read(z_bytes_reader_t *reader, uint8_t *dst, size_t len)
{
    buffer_t *from = reader->_bytes->_value;
    size_t left = from->size - reader->_at;
    len = len < left ? len : left;
    memcpy(dst, from->data + reader->_at, len);
    reader->_at += len;
    return len;
}

z_result_t z_view_keyexpr_from_str(z_view_keyexpr_t *keyexpr, const char *name)
{
    keyexpr->_val._value = (void *)name;
    return 0;
}

z_result_t z_keyexpr_as_view_string(const z_loaned_keyexpr_t *keyexpr, z_view_string_t *str)
{
    str->_val._value = keyexpr->_value;
    return 0;
}

const char *z_string_data(const z_loaned_string_t *str) { return str->_value; }
size_t z_string_len(const z_loaned_string_t *str) { return strlen(str->_value); }

const z_loaned_keyexpr_t *z_sample_keyexpr(const z_loaned_sample_t *sample) { return &sample->key; }
const z_loaned_bytes_t *z_sample_payload(const z_loaned_sample_t *sample) { return &sample->payload; }
const z_loaned_bytes_t *z_sample_attachment(const z_loaned_sample_t *sample)
{
    return z_bytes_len(&sample->attachment) ? &sample->attachment : NULL;
}
bool z_reply_is_ok(const z_loaned_reply_t *reply) { return reply != NULL; }
const z_loaned_sample_t *z_reply_ok(const z_loaned_reply_t *reply) { return &reply->sample; }

/* --- what the node asks for --- */

static void hex(const z_moved_bytes_t *bytes)
{
    size_t i;
    buffer_t *from = bytes ? bytes->_this._val._value : NULL;
    printf(" .");
    for (i = 0; from && i < from->size; i++)
        printf("%02x", from->data[i]);
    free(from);
}

static int keep(void (*call)(void *, void *), z_closure_drop_callback_t drop, void *context)
{
    closure_t made = {call, drop, context};
    closures[known] = made;
    return known++;
}

z_result_t z_closure_sample(z_owned_closure_sample_t *closure, z_closure_sample_callback_t call,
                            z_closure_drop_callback_t drop, void *context)
{
    closure->_val._value = &closures[keep((void (*)(void *, void *))call, drop, context)];
    return 0;
}

z_result_t z_closure_reply(z_owned_closure_reply_t *closure, z_closure_reply_callback_t call,
                           z_closure_drop_callback_t drop, void *context)
{
    closure->_val._value = &closures[keep((void (*)(void *, void *))call, drop, context)];
    return 0;
}

void z_put_options_default(z_put_options_t *options) { memset(options, 0, sizeof *options); }
void z_get_options_default(z_get_options_t *options) { memset(options, 0, sizeof *options); }

z_result_t z_put(const z_loaned_session_t *zs, const z_loaned_keyexpr_t *keyexpr, z_moved_bytes_t *payload,
                 const z_put_options_t *options)
{
    (void)zs;
    pthread_mutex_lock(&lock);
    printf("put %s", (const char *)keyexpr->_value);
    hex(payload);
    hex(options->attachment);
    printf("\n");
    fflush(stdout);
    pthread_mutex_unlock(&lock);
    return 0;
}

z_result_t z_get(const z_loaned_session_t *zs, const z_loaned_keyexpr_t *keyexpr, const char *parameters,
                 z_moved_closure_reply_t *callback, z_get_options_t *options)
{
    (void)zs;
    (void)parameters;
    pthread_mutex_lock(&lock);
    printf("get %s", (const char *)keyexpr->_value);
    hex(options->payload);
    hex(options->attachment);
    printf(" %d\n", (int)((closure_t *)callback->_this._val._value - closures));
    fflush(stdout);
    pthread_mutex_unlock(&lock);
    return 0;
}

z_result_t z_declare_background_subscriber(const z_loaned_session_t *zs, const z_loaned_keyexpr_t *keyexpr,
                                           z_moved_closure_sample_t *callback, const z_subscriber_options_t *options)
{
    (void)zs;
    (void)options;
    pthread_mutex_lock(&lock);
    printf("subscribe %s %d\n", (const char *)keyexpr->_value,
           (int)((closure_t *)callback->_this._val._value - closures));
    fflush(stdout);
    pthread_mutex_unlock(&lock);
    return 0;
}

z_result_t z_liveliness_declare_token(const z_loaned_session_t *zs, z_owned_liveliness_token_t *token,
                                      const z_loaned_keyexpr_t *keyexpr, const z_liveliness_token_options_t *options)
{
    (void)zs;
    (void)token;
    (void)options;
    pthread_mutex_lock(&lock);
    printf("token %s\n", (const char *)keyexpr->_value);
    fflush(stdout);
    pthread_mutex_unlock(&lock);
    return 0;
}

/* --- what comes --- */

static void *read_lines(void *unused)
{
    static char line[2000000], key[1000];
    (void)unused;
    while (fgets(line, sizeof line, stdin)) {
        int number;
        z_loaned_reply_t reply;
        if (sscanf(line, "over %d", &number) == 1) {
            closures[number].drop(closures[number].context);
        } else if (sscanf(line, "came %d %999s", &number, key) == 2) {
            char *payload = strstr(line, " .") + 2, *attachment = strstr(payload, " .");
            *attachment = 0;
            attachment += 2;
            attachment[strcspn(attachment, "\n")] = 0;
            reply.sample.key._value = key;
            reply.sample.payload._value = unhex(payload);
            reply.sample.attachment._value = unhex(attachment);
            closures[number].call(&reply, closures[number].context);
            free(reply.sample.payload._value);
            free(reply.sample.attachment._value);
        }
    }
    return NULL;
}

z_result_t z_config_default(z_owned_config_t *config) { return config == NULL; }
z_result_t zp_config_insert(z_loaned_config_t *config, uint8_t key, const char *value)
{
    return config == NULL || key < 0x40 || value == NULL;
}
z_result_t z_open(z_owned_session_t *zs, z_moved_config_t *config, const z_open_options_t *options)
{
    (void)zs;
    (void)config;
    (void)options;
    return 0;
}
z_result_t zp_start_read_task(z_loaned_session_t *zs, const zp_task_read_options_t *options)
{
    pthread_t thread;
    (void)zs;
    (void)options;
    return pthread_create(&thread, NULL, read_lines, NULL) != 0;
}
z_result_t zp_start_lease_task(z_loaned_session_t *zs, const zp_task_lease_options_t *options)
{
    (void)zs;
    return options != NULL;
}

z_result_t z_sleep_ms(size_t ms)
{
    struct timespec span = {(time_t)(ms / 1000), (long)(ms % 1000) * 1000000};
    return nanosleep(&span, NULL) != 0;
}

void z_random_fill(void *buf, size_t len)
{
    FILE *source = fopen("/dev/urandom", "rb");
    size_t got = fread(buf, 1, len, source);
    fclose(source);
    if (got < len)
        abort();
}

/* --- the board --- */

uint64_t clock_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000 + (uint64_t)now.tv_nsec + 123456789012345;
}

int measure_target(double *bearing_deg, double *level_db)
{
    *bearing_deg = 211.37;
    *level_db = 71.24;
    return 1;
}

typedef struct {
    const char *locator, *run, *id, *token, *authority, *certificate, *private_key;
} given_t;
int plain_node(const given_t *given);

/* stand_in RUN ID [TOKEN] */
int main(int argc, char **argv)
{
    given_t given = {"tcp/0.0.0.0:0", argv[1], argv[2], argc > 3 ? argv[3] : NULL, NULL, NULL, NULL};
    return plain_node(&given);
}
