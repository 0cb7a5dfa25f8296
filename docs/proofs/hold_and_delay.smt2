; hold_and_delay: theory §2.5, (star). The granted lease is at least T_hold, and what the old and the
; new command can lose together is at most E'. Da, D: drains of the acting and of the new force; s,
; t: how long each acts after the reading.
(set-logic QF_NRA)
(declare-const E Real)
(declare-const Th Real)
(declare-const Tl Real)      ; longest lease
(declare-const delta Real)   ; min(begins_within, rest of the acting lease)
(declare-const Da Real)
(declare-const D Real)
(declare-const valid Real)
(declare-const s Real)
(declare-const t Real)
(assert (and (> Th 0) (>= Tl Th) (>= delta 0) (>= Da 0) (>= D 0)))
(assert (<= (+ (* Th D) (* delta Da)) E))
(assert (or (and (= D 0) (= valid Tl)) (and (> D 0) (<= (* Tl D) (- E (* delta Da))) (= valid Tl)) (and (> D 0) (> (* Tl D) (- E (* delta Da))) (= (* valid D) (- E (* delta Da))))))
(assert (and (<= 0 t) (<= t valid)))
(assert (and (<= 0 s) (<= s delta)))  ; dropped in the twin
(assert (<= (* s Da) (* delta Da)))  ; hint
(assert (<= (* t D) (* valid D)))  ; hint
(assert (=> (> D 0) (or (>= valid Th) (< (* valid D) (* Th D)))))  ; hint
(assert (or (< valid Th) (< (- E (* s Da) (* t D)) 0)))  ; negated conclusion
(check-sat)
