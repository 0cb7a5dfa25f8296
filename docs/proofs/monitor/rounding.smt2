; rounding: theory §3.1. What passes as rounding passes once: M counts it as a debt, so that however
; many commands follow, the energy stays above -R - l D. Da, D: drains of the acting and of the new
; force; s, t: how long each acts after the reading.
(set-logic QF_NRA)
(declare-const E Real)      ; at the reading
(declare-const M Real)      ; counted on, debts included
(declare-const R Real)      ; 1 nJ
(declare-const l Real)      ; 1 ns
(declare-const delta Real)  ; min(begins_within, rest of the acting lease)
(declare-const Da Real)
(declare-const D Real)
(declare-const tau Real)    ; lease
(declare-const s Real)
(declare-const t Real)
(assert (and (>= R 0) (>= l 0) (>= delta 0) (>= Da 0) (>= D 0) (>= tau 0)))
(assert (<= M E))  ; dropped in the twin
(assert (<= (- (* tau D) (* l D)) (+ (- M (* delta Da)) R)))
(assert (and (<= 0 s) (<= s delta)))
(assert (and (<= 0 t) (<= t tau)))
(assert (<= (* s Da) (* delta Da)))  ; hint
(assert (<= (* t D) (* tau D)))  ; hint
(assert (< (- E (* s Da) (* t D)) (- (- R) (* l D))))  ; negated conclusion
(check-sat)
