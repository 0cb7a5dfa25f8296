; supplied_energy: theory §1. What the hand supplies over a step of the implicit midpoint rule is the
; change of kinetic energy plus the absorbed energy A; so with E >= 0 it can extract no more than the
; kinetic energy at the start.
(set-logic QF_NRA)
(declare-const m Real)
(declare-const h Real)
(declare-const u Real)    ; velocity before
(declare-const v Real)    ; and after
(declare-const d Real)    ; displacement
(declare-const fh Real)   ; force of the hand on the mass
(declare-const r Real)    ; force that friction and motors resist with
(declare-const A Real)    ; r d
(declare-const E Real)    ; E before
(declare-const K Real)    ; kinetic energy at the start
(declare-const W Real)    ; supplied until the step: change of kinetic energy plus E
(assert (and (> m 0) (> h 0)))
(assert (= (* m (- v u)) (* h (- fh r))))
(assert (= d (* h (/ 1 2) (+ u v))))
(assert (= A (* r d)))
(assert (= W (+ (- (* (/ 1 2) m u u) K) E)))
(assert (>= (+ E A) 0))  ; dropped in the twin
(assert (= (* m (- v u) d) (* h (- fh r) d)))  ; hint
(assert (= (* (- fh r) d) (* (/ 1 2) (- fh r) h (+ u v))))  ; hint
(assert (= (* (- fh r) h (+ u v)) (* m (- v u) (+ u v))))  ; hint
(assert (>= (* m v v) 0))  ; hint
(assert (< (+ W (* fh d)) (- K)))  ; negated conclusion
(check-sat)
