/* The part of zenoh-pico's API that the C of docs/microcontroller.md uses: the prototypes of its release 1.x, with opaque
   types. The library's own headers are include/zenoh-pico/api/{primitives,types,liveliness,olv_macros,macros}.h and
   system/common/platform.h. Only for compiling that code where the library is not at hand. */
#ifndef ZENOH_PICO_H
#define ZENOH_PICO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef int8_t z_result_t;

#define OWNED(name)                                       \
    typedef struct {                                      \
        void *_value;                                     \
    } z_loaned_##name##_t;                                \
    typedef struct {                                      \
        z_loaned_##name##_t _val;                         \
    } z_owned_##name##_t;                                 \
    typedef struct {                                      \
        z_owned_##name##_t _this;                         \
    } z_moved_##name##_t;                                 \
    const z_loaned_##name##_t *z_##name##_loan(const z_owned_##name##_t *obj); \
    z_loaned_##name##_t *z_##name##_loan_mut(z_owned_##name##_t *obj); \
    z_moved_##name##_t *z_##name##_move(z_owned_##name##_t *obj); \
    void z_##name##_drop(z_moved_##name##_t *obj);
#define VIEW(name)                                        \
    typedef struct {                                      \
        z_loaned_##name##_t _val;                         \
    } z_view_##name##_t;                                  \
    const z_loaned_##name##_t *z_view_##name##_loan(const z_view_##name##_t *obj);

OWNED(bytes)
OWNED(string)
OWNED(keyexpr)
OWNED(config)
OWNED(session)
OWNED(liveliness_token)
OWNED(closure_sample)
OWNED(closure_reply)
OWNED(encoding)
VIEW(string)
VIEW(keyexpr)

typedef struct z_loaned_sample_t z_loaned_sample_t;
typedef struct z_loaned_reply_t z_loaned_reply_t;
typedef struct z_timestamp_t z_timestamp_t;

typedef struct {
    const z_loaned_bytes_t *_bytes;
    size_t _at;
} z_bytes_reader_t;

typedef enum { Z_CONGESTION_CONTROL_BLOCK = 0, Z_CONGESTION_CONTROL_DROP = 1 } z_congestion_control_t;
typedef enum { Z_PRIORITY_DATA = 5 } z_priority_t;
typedef enum { Z_QUERY_TARGET_BEST_MATCHING = 0 } z_query_target_t;
typedef enum { Z_CONSOLIDATION_MODE_AUTO = -1 } z_consolidation_mode_t;
typedef struct {
    z_consolidation_mode_t mode;
} z_query_consolidation_t;

typedef struct {
    z_moved_encoding_t *encoding;
    z_congestion_control_t congestion_control;
    z_priority_t priority;
    z_timestamp_t *timestamp;
    bool is_express;
    z_moved_bytes_t *attachment;
} z_put_options_t;

typedef struct {
    z_moved_bytes_t *payload;
    z_moved_encoding_t *encoding;
    z_query_consolidation_t consolidation;
    z_congestion_control_t congestion_control;
    z_priority_t priority;
    bool is_express;
    z_query_target_t target;
    uint64_t timeout_ms;
    z_moved_bytes_t *attachment;
} z_get_options_t;

typedef struct z_open_options_t z_open_options_t;
typedef struct z_subscriber_options_t z_subscriber_options_t;
typedef struct z_liveliness_token_options_t z_liveliness_token_options_t;
typedef struct zp_task_read_options_t zp_task_read_options_t;
typedef struct zp_task_lease_options_t zp_task_lease_options_t;

typedef void (*z_closure_drop_callback_t)(void *arg);
typedef void (*z_closure_sample_callback_t)(z_loaned_sample_t *sample, void *arg);
typedef void (*z_closure_reply_callback_t)(z_loaned_reply_t *reply, void *arg);

#define Z_CONFIG_MODE_KEY 0x40
#define Z_CONFIG_CONNECT_KEY 0x41
#define Z_CONFIG_TLS_ROOT_CA_CERTIFICATE_BASE64_KEY 0x4C
#define Z_CONFIG_TLS_ENABLE_MTLS_KEY 0x51
#define Z_CONFIG_TLS_CONNECT_PRIVATE_KEY_BASE64_KEY 0x53
#define Z_CONFIG_TLS_CONNECT_CERTIFICATE_BASE64_KEY 0x55

z_result_t z_config_default(z_owned_config_t *config);
z_result_t zp_config_insert(z_loaned_config_t *config, uint8_t key, const char *value);
z_result_t z_open(z_owned_session_t *zs, z_moved_config_t *config, const z_open_options_t *options);
z_result_t zp_start_read_task(z_loaned_session_t *zs, const zp_task_read_options_t *options);
z_result_t zp_start_lease_task(z_loaned_session_t *zs, const zp_task_lease_options_t *options);

z_result_t z_view_keyexpr_from_str(z_view_keyexpr_t *keyexpr, const char *name);
z_result_t z_keyexpr_as_view_string(const z_loaned_keyexpr_t *keyexpr, z_view_string_t *str);
const char *z_string_data(const z_loaned_string_t *str);
size_t z_string_len(const z_loaned_string_t *str);

z_result_t z_bytes_copy_from_buf(z_owned_bytes_t *bytes, const uint8_t *data, size_t len);
size_t z_bytes_len(const z_loaned_bytes_t *bytes);
z_bytes_reader_t z_bytes_get_reader(const z_loaned_bytes_t *bytes);
size_t z_bytes_reader_read(z_bytes_reader_t *reader, uint8_t *dst, size_t len);

const z_loaned_keyexpr_t *z_sample_keyexpr(const z_loaned_sample_t *sample);
const z_loaned_bytes_t *z_sample_payload(const z_loaned_sample_t *sample);
const z_loaned_bytes_t *z_sample_attachment(const z_loaned_sample_t *sample);
bool z_reply_is_ok(const z_loaned_reply_t *reply);
const z_loaned_sample_t *z_reply_ok(const z_loaned_reply_t *reply);

z_result_t z_closure_sample(z_owned_closure_sample_t *closure, z_closure_sample_callback_t call,
                            z_closure_drop_callback_t drop, void *context);
z_result_t z_closure_reply(z_owned_closure_reply_t *closure, z_closure_reply_callback_t call,
                           z_closure_drop_callback_t drop, void *context);

void z_put_options_default(z_put_options_t *options);
z_result_t z_put(const z_loaned_session_t *zs, const z_loaned_keyexpr_t *keyexpr, z_moved_bytes_t *payload,
                 const z_put_options_t *options);
void z_get_options_default(z_get_options_t *options);
z_result_t z_get(const z_loaned_session_t *zs, const z_loaned_keyexpr_t *keyexpr, const char *parameters,
                 z_moved_closure_reply_t *callback, z_get_options_t *options);
z_result_t z_declare_background_subscriber(const z_loaned_session_t *zs, const z_loaned_keyexpr_t *keyexpr,
                                           z_moved_closure_sample_t *callback, const z_subscriber_options_t *options);
z_result_t z_liveliness_declare_token(const z_loaned_session_t *zs, z_owned_liveliness_token_t *token,
                                      const z_loaned_keyexpr_t *keyexpr, const z_liveliness_token_options_t *options);

z_result_t z_sleep_ms(size_t time);
void z_random_fill(void *buf, size_t len);

#define z_loan(x)                                   \
    _Generic((x),                                   \
        z_owned_session_t: z_session_loan,          \
        z_owned_bytes_t: z_bytes_loan,              \
        z_view_string_t: z_view_string_loan,        \
        z_view_keyexpr_t: z_view_keyexpr_loan)(&x)
#define z_loan_mut(x)                               \
    _Generic((x),                                   \
        z_owned_config_t: z_config_loan_mut,        \
        z_owned_session_t: z_session_loan_mut)(&x)
#define z_move(x)                                   \
    _Generic((x),                                   \
        z_owned_config_t: z_config_move,            \
        z_owned_session_t: z_session_move,          \
        z_owned_bytes_t: z_bytes_move,              \
        z_owned_liveliness_token_t: z_liveliness_token_move, \
        z_owned_closure_sample_t: z_closure_sample_move, \
        z_owned_closure_reply_t: z_closure_reply_move)(&x)
#define z_drop(x)                                   \
    _Generic((x),                                   \
        z_moved_session_t *: z_session_drop,        \
        z_moved_liveliness_token_t *: z_liveliness_token_drop)(x)
#define z_closure(closure, call, drop, context)     \
    _Generic((closure),                             \
        z_owned_closure_sample_t *: z_closure_sample, \
        z_owned_closure_reply_t *: z_closure_reply)(closure, call, drop, context)

#endif
