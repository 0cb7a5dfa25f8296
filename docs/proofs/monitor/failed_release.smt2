; failed_release: theory §3.2. A force F that was told to end, and is confirmed to have ended t after
; the last reading, can have drawn until then at most the smaller of t D(F) and of F over the diagonal
; L of the workspace. s: when it ended; x: the way along F until then; d: what it drew; E, M: true and
; counted energy at that reading.
(set-logic QF_NRA)
(declare-const E Real)
(declare-const M Real)
(declare-const F Real)
(declare-const D Real)
(declare-const L Real)
(declare-const s Real)
(declare-const t Real)
(declare-const x Real)
(declare-const d Real)
(declare-const m Real)
(assert (and (<= M E) (>= F 0) (>= D 0) (>= L 0)))
(assert (and (<= 0 s) (<= s t)))
(assert (<= d (* s D)))
(assert (<= d (* F x)))
(assert (<= x L))  ; dropped in the twin
(assert (= m (ite (<= (* t D) (* F L)) (* t D) (* F L))))
(assert (<= (* s D) (* t D)))  ; hint
(assert (<= (* F x) (* F L)))  ; hint
(assert (< (- E d) (- M m)))  ; negated conclusion
(check-sat)
