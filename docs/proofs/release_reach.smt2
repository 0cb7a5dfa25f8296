; release_reach: theory §2.5. Along the force, an unread release ended no further than b + c from the
; first reading, and the path in the hole is at least 2a - along - 2c, a the place of the release.
; Positions along the force, relative to the first reading.
(set-logic QF_LRA)
(declare-const x0 Real)     ; true position at the first reading
(declare-const xl Real)     ; where the force ended: a
(declare-const x1 Real)     ; true position at the second reading
(declare-const along Real)  ; measured displacement
(declare-const c Real)      ; error of a reading along the force
(declare-const r Real)      ; v_max s
(declare-const l Real)      ; v_max (T - s)
(declare-const b Real)
(declare-const path Real)
(assert (and (>= c 0) (>= r 0) (>= l 0)))
(assert (and (<= x0 c) (<= x1 (+ along c))))
(assert (<= (- xl x0) r))
(assert (<= (- xl x1) l))  ; dropped in the twin
(assert (= b (ite (<= r (+ along l)) r (+ along l))))
(assert (and (>= path (+ (- xl x0) (- xl x1)))))
(assert (or (> xl (+ b c)) (< path (- (* 2 xl) along (* 2 c)))))  ; negated conclusion
(check-sat)
