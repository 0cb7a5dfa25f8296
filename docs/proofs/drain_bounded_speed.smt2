; drain_bounded_speed: theory §2.6. For a hand no faster than V the extracted power x v - fd v^2 is at
; most D: x^2 / (4 fd) while x <= 2 fd V, else V (x - fd V). fd may be 0 in the second case.
(set-logic QF_NRA)
(declare-const fd Real)
(declare-const x Real)   ; (|F| - fco)+
(declare-const v Real)
(declare-const V Real)   ; v_max
(declare-const D Real)
(assert (and (>= fd 0) (>= x 0) (>= v 0) (> V 0)))
(assert (<= v V))  ; dropped in the twin
(assert (or (and (<= x (* 2 fd V)) (> fd 0) (= (* 4 fd D) (* x x))) (and (> x (* 2 fd V)) (= D (* V (- x (* fd V)))))))
(assert (>= (* (- x (* 2 fd v)) (- x (* 2 fd v))) 0))  ; hint
(assert (=> (> x (* 2 fd V)) (>= (* (- V v) (- x (* 2 fd V))) 0)))  ; hint
(assert (>= (* fd (- V v) (- V v)) 0))  ; hint
(assert (> (- (* x v) (* fd v v)) D))  ; negated conclusion
(check-sat)
