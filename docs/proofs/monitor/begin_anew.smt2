; begin_anew: theory §3.1. An account that begins anew at a reading taken s after the last force was
; to end begins with no more than E: position and force are late by s together, at most, so that no
; force acts after the position.
(set-logic QF_NRA)
(declare-const a Real)   ; the last force was to end by then
(declare-const b Real)   ; the account begins anew
(declare-const s Real)
(declare-const x Real)   ; so old is the position
(declare-const y Real)   ; so late the force ended
(declare-const o Real)   ; so long it acted after the position
(declare-const D Real)   ; its drain
(declare-const M Real)   ; counted on, and carried over
(declare-const E Real)   ; at the position
(declare-const Ee Real)  ; when no force acts any more
(assert (and (>= x 0) (>= y 0) (<= (+ x y) s) (>= D 0)))
(assert (= o (ite (> (+ a y) (- b x)) (- (+ a y) (- b x)) 0)))
(assert (<= M E))
(assert (>= Ee (- E (* o D))))
(assert (>= (- b a) s))  ; dropped in the twin
(assert (= o 0))  ; hint
(assert (< Ee M))  ; negated conclusion
(check-sat)
