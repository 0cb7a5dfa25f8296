/* SPDX-License-Identifier: Apache-2.0 */
/** @file
 * palpate_tissue.h - the tissue of Palpate without its processes: the force of a scene on tools,
 * step by step, for one scene or thousands. For C and whatever can call C; C++ has
 * palpate_tissue.hpp, Python the package palpate_tissue. Link libpalpate_tissue; flags: pkg-config
 * palpate_tissue.
 *
 * SI units, frame W of the scene; arrays of three are x, y, z. Structs filled with zeros are valid.
 * Nothing throws. What fails returns NULL or a status other than PALPATE_TISSUE_OK, has changed
 * nothing where it does not say so, and palpate_tissue_error() tells why and what to do. A batch is
 * used by one thread at a time, a scene by any number. The layout of the structs changes only with
 * the minor version while the major one is 0, then only with the major one. */
#ifndef PALPATE_TISSUE_H
#define PALPATE_TISSUE_H

#include <stddef.h>
#include <stdint.h>

/** Marks what the shared library exports. */
#ifndef PALPATE_API
#if defined(_WIN32)
#define PALPATE_API
#else
#define PALPATE_API __attribute__((visibility("default")))
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** What a call has come to. */
typedef enum palpate_tissue_status {
  PALPATE_TISSUE_OK = 0,           /**< done */
  PALPATE_TISSUE_NULL_POINTER = 1, /**< an argument is NULL that must not be */
  PALPATE_TISSUE_OUT_OF_RANGE = 2, /**< an index, a number or a struct of the input */
  PALPATE_TISSUE_NO_MEMORY = 3,    /**< memory is exhausted */
  PALPATE_TISSUE_FAILED = 4        /**< anything else */
} palpate_tissue_status;

/** A scene, read once: surfaces, elastic bodies and what is known of them. Does not change. */
typedef struct palpate_scene palpate_scene;
/** Copies of a scene, each under tools and on a time of its own. */
typedef struct palpate_batch palpate_batch;
/** The state of one copy. */
typedef struct palpate_snapshot palpate_snapshot;

/** Every copy of a batch, in place of an index. */
#define PALPATE_EVERY SIZE_MAX
/** Places of contact in a palpate_tool_force. */
#define PALPATE_MOST_CONTACTS 8

/** Where a tool is to go in the next step. */
typedef struct palpate_tool {
  double position_m[3];       /**< of the centre of the tip; finite, within +-1000 */
  double velocity_m_per_s[3]; /**< at the end of the step, for damping; used if known */
  double orientation_wxyz[4]; /**< unit quaternion; its z leads to the handle. Zeros: none */
  int32_t is_velocity_known;  /**< 0: the velocity is that of the way in this step;
                                   how fast the tool turns is that of the way anyhow */
  int32_t are_jaws_closed;    /**< not 0: closed, if the scene's tool has a gripper */
} palpate_tool;

/** Where a tool touches a tissue. */
typedef struct palpate_contact {
  double point_m[3];              /**< of the surface as it is where no tool touches it */
  double normal[3];               /**< unit, out of the tissue */
  double force_on_tool_newton[3]; /**< of this tissue */
  double penetration_m;           /**< > 0, of the tip or the shaft into that surface */
  double error_newton;            /**< bound of the force's error against a full solution: 0 where
                                       the law is evaluated exactly; NaN: not known */
  uint32_t tissue;                /**< index in the scene */
  int32_t is_shaft;               /**< 0: the tip */
} palpate_contact;

/** What the tissues do to a tool at the end of a step. */
typedef struct palpate_tool_force {
  double force_on_tool_newton[3];    /**< of all tissues */
  double torque_on_tool_newton_m[3]; /**< of all tissues, about the centre of the tip */
  double stored_energy_joule;        /**< elastic */
  double error_newton;               /**< sum of those of the contacts */
  uint32_t contact_count;            /**< of all contacts; may be more than listed */
  uint32_t listed_count;             /**< of contacts, the deepest first */
  palpate_contact contacts[PALPATE_MOST_CONTACTS]; /**< the deepest first */
} palpate_tool_force;

/** A surface of triangles. The pointers stay valid until the next call for the same tissue of the
 * same copy, or the end of the batch. */
typedef struct palpate_surface {
  const float* vertices_m; /**< 3 each; of elastic tissue as the last full solution has them */
  const float* strain; /**< equivalent strain at the vertices; NULL: the tissue is not elastic */
  const uint32_t* triangles; /**< 3 vertices each, counter-clockwise seen from outside */
  size_t vertex_count;       /**< of vertices_m and strain */
  size_t triangle_count;     /**< of triangles */
} palpate_surface;

/** The version of the library, "0.1.0". */
PALPATE_API const char* palpate_tissue_version(void);
/** What the last call on this thread that failed complained about: value, rule and remedy. "" if
 * none has. Valid until the next call that fails on this thread. */
PALPATE_API const char* palpate_tissue_error(void);

/** Reads the scene of a session file; seconds for large elastic bodies.
 * @param file  as `palpate scene check` takes it
 * @param sets  "path=value", as with --set: overrides in the file; NULL where set_count is 0
 * @param set_count  of them
 * @return  NULL: failed; every problem is told with file, line and field */
PALPATE_API palpate_scene* palpate_scene_load(const char* file, const char* const* sets,
                                              size_t set_count);
/** The same from memory.
 * @param text    a session in protobuf text format; its scene is enough
 * @param folder  base of the relative paths in it; NULL: it may name no file
 * @param sets    as above   @param set_count  of them
 * @return  NULL: failed */
PALPATE_API palpate_scene* palpate_scene_parse(const char* text, const char* folder,
                                               const char* const* sets, size_t set_count);
/** Frees a scene; batches of it stay. NULL is allowed. */
PALPATE_API void palpate_scene_destroy(palpate_scene* scene);
/** How many tissues there are; 0 for NULL. */
PALPATE_API size_t palpate_scene_tissue_count(const palpate_scene* scene);
/** The name of a tissue; NULL beyond. */
PALPATE_API const char* palpate_scene_tissue_name(const palpate_scene* scene, size_t tissue);
/** Radius of the tip of the tools [m]; 0 for NULL. */
PALPATE_API double palpate_scene_tip_radius_m(const palpate_scene* scene);

/** Makes copies of a scene.
 * @param scene    which may be destroyed before the batch
 * @param scenes   1 .. 1,000,000 copies   @param tools  1 .. 64 in each
 * @param threads  1 .. 1024 that make the steps; 0: one for each processor
 * @return  NULL: failed */
PALPATE_API palpate_batch* palpate_batch_create(const palpate_scene* scene, size_t scenes,
                                                size_t tools, size_t threads);
/** Frees a batch. NULL is allowed. */
PALPATE_API void palpate_batch_destroy(palpate_batch* batch);
/** The tools of the first copy, then of the next, to be written before a step; NULL for NULL. */
PALPATE_API palpate_tool* palpate_batch_tools(palpate_batch* batch);
/** What the last step has come to, in the same order; zeros before; NULL for NULL. */
PALPATE_API const palpate_tool_force* palpate_batch_forces(const palpate_batch* batch);

/** The tools go on a straight way to where they are to be, in all copies. Each copy gives the same
 * numbers to the bit as alone, whatever the number of threads. Between two full solutions of an
 * elastic tissue (elastic.solve_rate_hz) there should be some parts; a part longer than the period
 * of the solutions moves the body by one period only.
 * @param batch  whose palpate_batch_tools() say where to
 * @param dt_s   of the step, 1e-6 .. 10   @param parts  1 .. 100,000 equal ones, as if so many
 * steps
 * @return  not PALPATE_TISSUE_OK: nothing has moved; PALPATE_TISSUE_FAILED,
 * PALPATE_TISSUE_NO_MEMORY: some copies may have moved; restore or reset them */
PALPATE_API palpate_tissue_status palpate_batch_step(palpate_batch* batch, double dt_s,
                                                     uint32_t parts);
/** Seconds that a copy has moved since its time 0; NaN beyond. */
PALPATE_API double palpate_batch_time_s(const palpate_batch* batch, size_t copy);
/** A copy, or PALPATE_EVERY, as it was before the first step; its next step begins at this time,
 * which matters to tissue that moves by itself. Its tools and forces stay as they are. */
PALPATE_API palpate_tissue_status palpate_batch_reset(palpate_batch* batch, size_t copy,
                                                      double time_s);
/** Keeps the state of a copy. @return  NULL: failed */
PALPATE_API palpate_snapshot* palpate_batch_snapshot(const palpate_batch* batch, size_t copy);
/** A copy, or PALPATE_EVERY, continues from that state to the bit. The snapshot must be of a batch
 * of the same scene with as many tools. */
PALPATE_API palpate_tissue_status palpate_batch_restore(palpate_batch* batch, size_t copy,
                                                        const palpate_snapshot* snapshot);
/** Frees a snapshot. NULL is allowed. */
PALPATE_API void palpate_snapshot_destroy(palpate_snapshot* snapshot);

/** Fills `surface` with that of a tissue in a copy, as it is now. */
PALPATE_API palpate_tissue_status palpate_batch_surface(palpate_batch* batch, size_t copy,
                                                        size_t tissue, palpate_surface* surface);

#ifdef __cplusplus
}
#endif

#endif /* PALPATE_TISSUE_H */
